"""A joint jams for 0.6 s: what motion control and path control do when it is let go.

Writes one page with the arms beside each other, and a figure. Usage: python examples/jammed_joint.py [folder]
"""

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")

jam = pc.compare(None, "jammed-joint")

print(f"{'':22}contour [deg]   speed [deg/s]   time lost [s]")
for law in jam.measures:
    contour, speed = (np.rad2deg(jam.mean(law, name)) for name in ("contour_peak", "speed_peak"))
    print(f"{law:22}{contour:13.1f}{speed:16.0f}{jam.mean(law, 'time_lost_s'):16.2f}")

pc.save_figure(pc.scenario_figure(jam), out / "jammed_joint")
pc.save_comparison(jam, out / "jammed_joint.html")
