"""An experiment file to which tests add a disturbance."""

CIRCLE_FILE = """
duration = 0.3
[robot]
source = "cicese_2dof"
[task]
type = "circle"
radius = 0.5
speed = 1.0
[controller]
type = "extended_motion_plan"
K_p = 800.0
K_v = [45.0, 100.0]
k = 20.0
"""
