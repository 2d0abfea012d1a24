"""The results for a person, on a terminal and as a page of the documentation."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Iterator
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.measure import Results
from benchmarks.peers import missing

#: what is asked of a ratio: its meaning, whether more is better, and the goal
GOALS = {
    "single": ("speed of one rollout over the plain loop's", True, 40.0),
    "single_seven_joints": ("the same with seven joints", True, 15.0),
    "mujoco_single": ("the same over MuJoCo stepped from Python, two joints", True, 15.0),
    "batch1000_1thread": ("speed of 1000 rollouts on one thread over the plain loop's", True, 120.0),
    "batch1000_2threads": ("the same on two threads", True, 200.0),
    "seven_joints": ("the same with seven joints, one thread", True, 50.0),
    "mjbatch_seven_joints": ("the same over mjbatch's, seven joints, one thread", True, 6.0),
    "own_task": ("time with a path of q_d and ϑ only over that with the circle", False, 1.5),
    "wrapped_law": ("time with a paced and overridden law over that with the law inside", False, 5.0),
    "wrapped_over_reference": ("speed of that paced and overridden law over the reference in Python", True, 20.0),
    "sweep_over_simulation": ("time of a sweep with four metrics over that of its simulations", False, 2.2),
    "control_tick_us": ("one control tick, law and plan [µs]", False, 3.0),
    "control_tick_over_rnea": ("the same over one raw RNEA call", False, 4.0),
}
PACKAGES = ("pathcontrol", "pin", "numpy", "mujoco", "mjbatch", "drake", "roboticstoolbox-python")
HEADINGS = ("arm", "what", "µs per rollout and tick", "speed over the plain loop")


def goal_lines(results: Results) -> Iterator[tuple[str, str, str, str]]:
    """Name, meaning, value and goal of each ratio that has one, marked where it is not reached."""
    for name, (meaning, more, goal) in GOALS.items():
        if name not in results.ratios:  # a peer that is not installed
            yield name, meaning, "not measured", f"{'≥' if more else '≤'} {goal:g}"
            continue
        value = results.ratios[name]
        reached = value >= goal if more else value <= goal
        yield name, meaning, f"{value:.2f}", f"{'≥' if more else '≤'} {goal:g}{'' if reached else ', not reached'}"


def row_lines(results: Results) -> Iterator[tuple[str, str, str, str]]:
    """The rows of the table as texts."""
    for arm, what, microseconds, speed in results.rows:
        yield arm, what, f"{microseconds:.2f}", f"{speed:.2f}"


def growth_lines(results: Results) -> Iterator[tuple[str, str, str]]:
    """Rollouts, ticks and µs per rollout and tick."""
    for (rollouts, ticks), microseconds in results.growth.items():
        yield f"{rollouts}", f"{ticks}", f"{microseconds:.2f}"


def show(results: Results) -> None:
    """Print it."""
    console = Console()
    for title, headings, lines in _tables(results):
        table = Table(title=title)
        for heading in headings:
            table.add_column(heading)
        for line in lines:
            table.add_row(*line)
        console.print(table)
    console.print(f"not installed: {', '.join(missing()) or 'nothing'}")


def write_page(results: Results, page: Path) -> None:
    """Put the tables in the place of those between the page's two marks."""
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition("<!-- measured -->\n")
    after = rest.partition("<!-- end -->")[2]
    tables = "\n".join(_markdown(headings, lines) for _, headings, lines in _tables(results))
    page.write_text(f"{before}<!-- measured -->\n{_machine()}\n\n{tables}<!-- end -->{after}", encoding="utf-8")


def _tables(results: Results) -> list[tuple[str, Iterable[str], Iterable[Iterable[str]]]]:
    return [
        ("Goals", ("name", "ratio", "measured", "goal"), goal_lines(results)),
        ("Side by side", HEADINGS, row_lines(results)),
        ("Growth of our cost, 2 joints", ("rollouts", "ticks", "µs per rollout and tick"), growth_lines(results)),
    ]


def _markdown(headings: Iterable[str], lines: Iterable[Iterable[str]]) -> str:
    headings = list(headings)
    rows = [headings, ["---"] * len(headings), *lines]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _machine() -> str:
    """Processor, system and versions."""
    info = Path("/proc/cpuinfo")
    models = [line for line in info.read_text().splitlines() if line.startswith("model name")] if info.exists() else []
    processor = models[0].partition(":")[2].strip() if models else platform.processor()
    versions = ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    return (
        f"Measured on {date.today():%-d %B %Y}: {os.cpu_count()} cores of {processor}, load {os.getloadavg()[0]:.1f}, "
        f"{platform.system()}, Python {platform.python_version()}; {versions}."
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
