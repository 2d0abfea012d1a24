"""The paper's two experiments on the bundled arm, section 5, with the published parameters and nothing tuned."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pathcontrol._files import whole_file
from pathcontrol._progress import progress_bar
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.analysis.run_metrics import peak, steady_state
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.projection import Projection
from pathcontrol.errors import EngineError
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.engines import Engine
from pathcontrol.simulation.loops import SampledLoop
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle

RADIUS_DEG, SPEED_DEG_S = 57.3, 114.59
K_P, K_V, K = 800.0, (45.0, 100.0), 20.0
START_DEG = (40.0, 70.0)
PERIOD, DURATION = 2.5e-3, 10.0

#: the paper's steady-state peaks and the numbers of its figures
PAPER: dict[str, dict[str, float]] = {
    "extended_motion_plan": {"e_p_peak_deg": 1.5, "e_v_peak_deg_s": 14.5},
    "projection": {"e_p_peak_deg": 1.4, "e_v_peak_deg_s": 17.2},
}
FIGURES = {"extended_motion_plan": ("figure_07", "figure_08"), "projection": ("figure_09", "figure_10")}


@dataclass(frozen=True)
class Experiment:
    """One of the two experiments: its run, and the steady-state peaks as the paper gives them."""

    name: str
    controller: Controller
    run: Run

    @property
    def peaks(self) -> dict[str, float]:
        """Peaks of ‖e_p‖ [deg] and ‖e_v‖ [deg/s] over the second half, from what the controller measures."""
        late = steady_state(self.run)
        return {
            "e_p_peak_deg": float(np.rad2deg(peak(late.norm("e_p"))[0])),
            "e_v_peak_deg_s": float(np.rad2deg(peak(late.norm("e_v"))[0])),
        }


def paper_task() -> Circle:
    """The circle of (9) and (10): r₀ = 57.3 deg, v₀ = 114.59 deg/s, about the origin of joint space."""
    return Circle(np.deg2rad(RADIUS_DEG), np.deg2rad(SPEED_DEG_S))


def paper_loop() -> SampledLoop:
    """The control computer of the arm: 2.5 ms, encoders, velocity by differentiation, torque limits."""
    return SampledLoop(period=PERIOD, encoders=True, velocity="difference", torque_limits=True)


def paper_controllers(robot: RobotModel) -> dict[str, Controller]:
    """Both path controllers with the published gains; viscous friction compensated, Coulomb friction not."""
    task = paper_task()
    return {
        "extended_motion_plan": ExtendedMotionPlan(robot, task, K_P, K_V, K),
        "projection": Projection(robot, task, K_P, K_V),
    }


def paper_experiment(name: str, robot: RobotModel, progress: bool = True, engine: Engine = "pinocchio") -> Experiment:
    """Run one of the two, by its name in :data:`PAPER`; on the reference engine unless told otherwise."""
    controller = paper_controllers(robot)[name]
    start = np.deg2rad(START_DEG)
    run = simulate(controller, start, duration=DURATION, loop=paper_loop(), engine=engine, progress=progress)
    return Experiment(name, controller, run)


def reproduce(out: str | Path) -> dict[str, Any]:
    """Run both experiments and write data, figures, animations and ``summary.json`` to the folder ``out``.

    Returns:
        What ``summary.json`` holds.
    """
    out = refuse_suffix(out, "a folder")
    began, robot, experiments = time.perf_counter(), load_robot("cicese_2dof"), {}
    with progress_bar("reproducing", 2 * len(PAPER)) as update:
        for i, name in enumerate(PAPER):
            experiments[name] = paper_experiment(name, robot, progress=False)
            update(2 * i + 1)
            _write(experiments[name], robot, out)
            update(2 * i + 2)
    summary = summarise(experiments) | {"compiled_engine": compare_engines(experiments.values(), robot)}
    summary |= {"seconds": round(time.perf_counter() - began, 2)}
    with whole_file(out / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


def compare_engines(experiments: Iterable[Experiment], robot: RobotModel) -> dict[str, Any]:
    """Return how far the compiled engine is from the runs of the reference: ``{name: {…}}``, or ``{"missing": why}``.

    For each experiment the largest difference of a joint position over the run, ``q_rad``, and those of the two peaks.
    """
    apart: dict[str, Any] = {}
    for reference in experiments:
        try:
            other = paper_experiment(reference.name, robot, progress=False, engine="compiled")
        except EngineError as error:
            return {"missing": str(error)}
        q = float(np.abs(other.run.array("q") - reference.run.array("q")).max())
        peaks = {name: abs(other.peaks[name] - value) for name, value in reference.peaks.items()}
        apart[reference.name] = {"q_rad": q, **peaks}
    return apart


def _write(experiment: Experiment, robot: RobotModel, out: Path) -> None:
    """Data, figures and animation of one experiment."""
    from pathcontrol.view.animation.record import record
    from pathcontrol.view.figures.errors import error_figure
    from pathcontrol.view.figures.path import path_figure
    from pathcontrol.view.figures.style import save_figure

    run, task = experiment.run, experiment.controller.task
    run.save(out / f"{experiment.name}.nc")
    path_name, error_name = FIGURES[experiment.name]
    save_figure(path_figure(run, task), out / path_name)
    save_figure(error_figure(run), out / error_name)
    record(run, robot, task=task).save(out / f"{experiment.name}.html")


def summarise(experiments: dict[str, Experiment]) -> dict[str, Any]:
    """Measured peaks beside the paper's, the versions and the settings."""
    peaks = {name: experiment.peaks | {"paper": PAPER[name]} for name, experiment in experiments.items()}
    configs = {name: dict(experiment.run.config) for name, experiment in experiments.items()}
    versions = [config.pop("versions") for config in configs.values()]  # the same for both
    return peaks | {"versions": versions[0], "settings": configs}
