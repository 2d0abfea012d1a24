"""Reading of DXF drawings."""

from pathcontrol.toolpaths.dxf.reader import read_dxf as read_dxf
