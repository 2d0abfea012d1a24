"""The largest error of each lap of the paper's experiments, with what is learned along the path and without.

Prints a table and writes ``learning.svg``. Usage: python -m benchmarks.learning [folder] [laps]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import pathcontrol as pc
from pathcontrol.comparison.paper import START_DEG, paper_controllers, paper_loop
from pathcontrol.view.figures.style import apply_style, new_figure, save_figure, style

NAMES = {"extended_motion_plan": "extended motion plan", "projection": "projection"}


def measure_errors(law: pc.Controller, laps: int) -> np.ndarray:
    """Return the largest ‖e_p‖ [deg] of each lap of the paper's experiment, (laps,)."""
    longest = 1.2 * law.task.period / 2.0 * laps + 2.0
    run = pc.simulate(law, np.deg2rad(START_DEG), duration=longest, laps=laps, loop=paper_loop())
    return np.rad2deg(pc.lap_errors(run))


def draw(errors: dict[str, np.ndarray], folder: Path) -> None:
    """Draw the errors of all laws over the laps."""
    with style():
        figure = new_figure(7.2, 2.9)
        axes = apply_style(figure.add_subplot())
        for name, error in errors.items():
            line = "--" if name.startswith("without") else "-"
            axes.plot(1 + np.arange(len(error)), error, line, marker=".", label=name)
        axes.axhline(0.15, color="#999999", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlabel="lap", ylabel="largest ‖e_p‖ [deg]", ylim=(0.02, 3.0))
        axes.legend()
        save_figure(figure, folder / "learning")


def main() -> None:
    """Measure, print and draw."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "results")
    laps = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    robot = pc.load_robot("cicese_2dof")
    errors = {}
    for name, law in paper_controllers(robot).items():
        errors[NAMES[name]] = measure_errors(pc.Learned(law), laps)
        errors[f"without learning, {NAMES[name]}"] = measure_errors(law, laps)
        print(NAMES[name], errors[NAMES[name]].round(3).tolist(), flush=True)
    draw(errors, folder)
    for lap in [n for n in (1, 2, 3, 4, 5, 6, 7, 8, 10, 20, 50, 100) if n <= laps]:
        print(f"| {lap} | " + " | ".join(f"{error[lap - 1]:.3f}" for error in errors.values()) + " |")


if __name__ == "__main__":
    main()
