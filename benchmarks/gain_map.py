"""The gain map of ``docs/stability.md``: the paper's circle under a loop with velocities by differences and a delay.

Usage: python -m benchmarks.gain_map [folder]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from benchmarks.cases import K_P, K_V, K
from pathcontrol import (
    Circle,
    ExtendedMotionPlan,
    SampledLoop,
    Viscous,
    load_robot,
    save_figure,
    stability_figure,
    stability_map,
)


def main(folder: Path) -> None:
    robot = load_robot("cicese_2dof")
    robot = robot.with_friction(Viscous(robot.friction.viscous))
    law = ExtendedMotionPlan(robot, Circle(1.0, 2.0), K_P, K_V, K)
    loop = SampledLoop(velocity="difference", delay=2.5e-3)
    gains = {"k": np.geomspace(1.0, 1e6, 19), "K_p": np.geomspace(100.0, 51200.0, 10)}
    found = stability_map(law, gains, loop, settle=1)
    for row, K_p in enumerate(found.grids[1]):
        edge = found.boundary[np.isclose(found.boundary[:, 1], K_p), 0]
        print(f"K_p = {K_p:6.0f}: decays at up to {found.decay_rate[:, row].max():6.2f} 1/s, unstable at k = {edge}")
    save_figure(stability_figure(found), folder / "gain_map", formats=["svg", "png"])


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results"))
