"""A strict reader of G-code.

No parser on the package index reads it so: gcodeparser skips what it does not understand, nc-gcode-interpreter takes it
for Sinumerik's calls of functions, and pygcode, last released in 2017, gives no line numbers and computes no arcs.
"""

from pathcontrol.toolpaths.gcode.reader import read_gcode as read_gcode
