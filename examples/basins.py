"""From how far an arm comes back to its path: basins of attraction beside the ball that the theorem guarantees.

Lets the paper's arm go from a grid of postures, at rest, with both of its laws, and writes a figure and numbers.
Usage: python examples/basins.py [folder] [starts] [torque limit of joint 1, N m] [of joint 2]
"""

import json
import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc

out = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
starts = int(sys.argv[2]) if len(sys.argv) > 2 else 225

arm, circle = pc.load_robot("cicese_2dof"), pc.Circle(np.deg2rad(57.3), np.deg2rad(114.59))
limits = [float(limit) for limit in sys.argv[3:5]] or True  # by default those of the arm
duration = 1.5 if limits is True else 2.5  # weak motors take longer
loop = pc.SampledLoop(encoders=True, velocity="difference", torque_limits=limits)
laws = {
    "extended motion plan": pc.ExtendedMotionPlan(arm, circle, 800.0, [45.0, 100.0], k=20.0),
    "projection": pc.Projection(arm, circle, 800.0, [45.0, 100.0]),
}
basins = {name: pc.basin(law, starts, margin=3.0, duration=duration, loop=loop) for name, law in laws.items()}
for name, found in basins.items():
    late = np.nanmax(found.return_time)
    print(f"{name}: {found.returned.sum()} of {len(found.q)} return, the last one after {late:.2f} s;")
    print(f"  guaranteed {found.guaranteed.sum()}, of which {(found.guaranteed & ~found.returned).sum()} do not")
pc.save_figure(pc.attraction_figure(basins), out / "basins", ["svg", "png"])
(out / "basins.json").write_text(json.dumps({name: one.to_dict() for name, one in basins.items()}, indent=1))
