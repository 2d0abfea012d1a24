"""A circle faster than the motors can: path control, and path control that is paced within their limits.

Writes one page with the arms beside each other, and a figure. Usage: python examples/weak_motors.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

laws = ["computed_torque", "projection", "paced_projection"]
weak = pc.compare(laws, "weak-motors", rollouts=1)

for law in weak.measures:
    contour, saturated = np.rad2deg(weak.mean(law, "contour_peak")), weak.mean(law, "saturated_s")
    print(f"{law:18} contour {contour:5.1f} deg, {saturated:.1f} s of 5 s at the torque limits")

paced = weak.runs["paced_projection"]
pc.save_figure(pc.torque_figure(paced, weak.scenario.robot.limits.effort), out / "weak_motors-torque")
pc.save_comparison(weak, out / "weak_motors.html")
