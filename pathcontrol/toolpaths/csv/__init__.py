"""Reading of tables of points: comma-separated values and the like."""

from pathcontrol.toolpaths.csv.reader import read_csv as read_csv
