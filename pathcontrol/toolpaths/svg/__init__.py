"""Reading of SVG drawings."""

from pathcontrol.toolpaths.svg.reader import read_svg as read_svg
