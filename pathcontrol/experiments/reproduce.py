"""The paper's two experiments on the bundled arm, section 5, with the published parameters and nothing tuned."""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import repeat
from multiprocessing import active_children, get_context
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from pathcontrol._files import remove_own_parts, whole_file
from pathcontrol._interrupts import delay_interrupt
from pathcontrol._progress import progress_bar
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.analysis.run_metrics import peak, steady_state
from pathcontrol.comparison.paper import DURATION, START_DEG, paper_controllers, paper_loop
from pathcontrol.control.base import Controller
from pathcontrol.errors import EngineError, SimulationError
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.engines import Engine
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.simulate import simulate

T = TypeVar("T")
_WRITERS = (
    "pathcontrol.simulation.storage.netcdf",
    "pathcontrol.simulation.storage.task_recipes",
    "pathcontrol.view.animation.record",
    "pathcontrol.view.figures.error_figures",
    "pathcontrol.view.figures.path_figures",
    "pathcontrol.view.page.html",
    "matplotlib.backends.backend_svg",
    "matplotlib.style",
    "PIL.Image",
    "rich.console",  # for the table of the command
    "rich.table",
)

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


def paper_experiment(name: str, robot: RobotModel, progress: bool = True, engine: Engine = "pinocchio") -> Experiment:
    """Run one of the two, by its name in :data:`PAPER`; on the reference engine by default."""
    controller = paper_controllers(robot)[name]
    start = np.deg2rad(START_DEG)
    run = simulate(controller, start, duration=DURATION, loop=paper_loop(), engine=engine, progress=progress)
    return Experiment(name, controller, run)


class Part(NamedTuple):
    """The numbers of one experiment whose files have been written.

    Attributes:
        peaks: as :attr:`Experiment.peaks`.
        config: that of its run.
        apart: how far the compiled engine is from it, as :func:`compare_engines` says.
    """

    peaks: dict[str, float]
    config: dict[str, Any]
    apart: dict[str, Any]


def reproduce(out: str | Path) -> dict[str, Any]:
    """Run both experiments and write data, figures, animations and ``summary.json`` to the folder ``out``.

    Each has a process of its own where there are two cores and no other threads, which a fork would lose; what draws
    is loaded while they simulate.

    Returns:
        What ``summary.json`` holds.
    """
    out, began = refuse_suffix(out, "a folder", name="out"), time.perf_counter()
    with _pause_collection(), progress_bar("reproducing", 2 * len(PAPER)) as update:
        with _open_map() as apply:
            simulated = apply(_simulate_one, PAPER)
            load_writers()
            runs = _collect(simulated, update)
        with _open_map() as apply:
            parts = _collect(apply(_write_one, runs.items(), repeat(out)), lambda done: update(len(PAPER) + done))
    summary = summarise(parts) | {"seconds": round(time.perf_counter() - began, 2)}
    with whole_file(out / "summary.json") as temporary:
        temporary.write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


def load_writers() -> None:
    """Import what writes the files and tells of them, before processes are made that would each import it."""
    with delay_interrupt():
        for name in _WRITERS:
            import_module(name)
        sys.modules["PIL.Image"].preinit()


@contextmanager
def _pause_collection() -> Iterator[None]:
    """Collect no garbage inside: what is loaded stays, and a round would copy all pages into each process."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _collect(results: Iterable[T], update: Callable[[int], None]) -> dict[str, T]:
    """Return the results by the names of the experiments, as they come."""
    found = {}
    for name, result in zip(PAPER, results, strict=True):
        found[name] = result
        update(len(found))
    return found


@contextmanager
def _open_map() -> Iterator[Callable[..., Iterable[Any]]]:
    """Give ``map``, or one that computes in processes, which know all that has been loaded here."""
    if threading.active_count() > 1 or len(os.sched_getaffinity(0)) < len(PAPER):
        yield map
        return
    with ProcessPoolExecutor(len(PAPER), get_context("fork"), _prepare_process) as pool:
        try:
            yield partial(_start_whole, pool)
        except KeyboardInterrupt:
            for process in active_children():  # of a Ctrl-C that only this process got
                process.terminate()
            raise
        except BrokenProcessPool as error:
            raise SimulationError(
                "a process that ran an experiment has ended before it was done, as when it is killed or memory runs "
                "out; free some, or run it with one core, as `taskset 1 pathcontrol reproduce` does on Linux"
            ) from error


def _start_whole(pool: ProcessPoolExecutor, function: Callable[..., T], *items: Iterable[Any]) -> Iterable[T]:
    """Begin to map in the processes of a pool; a Ctrl-C meanwhile comes when its thread runs, which it waits for."""
    with delay_interrupt():
        return pool.map(function, *items)


def _prepare_process() -> None:
    """Have this process leave at once at Ctrl-C and when it is terminated.

    An exception, which Python raises else, is lost and printed where it comes while an object is cleared away.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _leave)


def _leave(number: int, frame: object) -> None:
    """Remove files that are half written, and leave."""
    remove_own_parts()
    os._exit(128 + number)


def _simulate_one(name: str) -> Run:
    """Simulate one of the experiments."""
    return paper_experiment(name, load_robot("cicese_2dof"), progress=False).run


def _write_one(simulated: tuple[str, Run], out: Path) -> Part:
    """Write the files of one of the experiments."""
    (name, run), robot = simulated, load_robot("cicese_2dof")
    experiment = Experiment(name, paper_controllers(robot)[name], run)
    _write(experiment, robot, out)
    return Part(experiment.peaks, dict(run.config), compare_engines(experiment, robot))


def compare_engines(reference: Experiment, robot: RobotModel) -> dict[str, Any]:
    """Return how far the compiled engine is from an experiment on the reference, or ``{"missing": why}``.

    The largest difference of a joint position over the run, ``q_rad``, and those of the two peaks.
    """
    try:
        other = paper_experiment(reference.name, robot, progress=False, engine="compiled")
    except EngineError as error:
        return {"missing": str(error)}
    q = float(np.abs(other.run.array("q") - reference.run.array("q")).max())
    return {"q_rad": q} | {name: abs(other.peaks[name] - value) for name, value in reference.peaks.items()}


def _write(experiment: Experiment, robot: RobotModel, out: Path) -> None:
    """Write data, figures and animation of one experiment."""
    run, task = experiment.run, experiment.controller.task
    run.save(out / f"{experiment.name}.nc")

    # what draws, which takes longer to load than to write the run
    from pathcontrol.view.animation.record import record
    from pathcontrol.view.figures.error_figures import error_figure
    from pathcontrol.view.figures.path_figures import path_figure
    from pathcontrol.view.figures.style import save_figure

    path_name, error_name = FIGURES[experiment.name]
    save_figure(path_figure(run, task), out / path_name)
    save_figure(error_figure(run), out / error_name)
    record(run, robot, task=task).save(out / f"{experiment.name}.html")


def summarise(parts: Mapping[str, Part]) -> dict[str, Any]:
    """Return measured peaks beside the paper's, versions, settings, and how far the compiled engine is from them."""
    peaks = {name: part.peaks | {"paper": PAPER[name]} for name, part in parts.items()}
    configs = {name: dict(part.config) for name, part in parts.items()}
    versions = [config.pop("versions") for config in configs.values()]  # the same for both
    missing = [part.apart for part in parts.values() if "missing" in part.apart]
    apart = missing[0] if missing else {name: part.apart for name, part in parts.items()}
    return peaks | {"versions": versions[0], "settings": configs, "compiled_engine": apart}
