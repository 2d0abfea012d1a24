"""What an experiment file may say. Importing this loads nothing heavy; :mod:`.build` makes objects of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import PurePath
from typing import Annotated, Any, ClassVar, Literal

from pydantic import PlainValidator

from pathcontrol.experiments.arm_sections import Plant, Robot
from pathcontrol.experiments.controller_sections import Law, Loop, SampledSection
from pathcontrol.experiments.section import Section, Units
from pathcontrol.experiments.sweep_section import SweepSection
from pathcontrol.experiments.task_sections import Task
from pathcontrol.experiments.tune_section import TuneSection
from pathcontrol.experiments.values import Numbers, Positive, Whole, expected


class Start(Section):
    """``[start]``: the initial state, in ``angle_unit``; at rest at the beginning of the path unless told."""

    units: ClassVar[Units] = {"q": ("rad", "m"), "qd": ("rad/s", "m/s")}
    angles = ("q", "qd")
    q: Numbers | None = None
    qd: Numbers | None = None


def _file(*suffixes: str) -> PlainValidator:
    """Names of files below the output folder that end as the format asks."""
    wanted = " or ".join(suffix or "no suffix" for suffix in suffixes)

    def check(value: Any) -> str:
        path = PurePath(value) if isinstance(value, str) else PurePath()
        inside = path.name and not path.is_absolute() and ".." not in path.parts and "\0" not in str(path)
        if not inside or path.suffix not in suffixes:
            raise expected(f"a file name relative to the output folder, with {wanted}")
        return value

    return PlainValidator(check)


def _pair(value: Any) -> list[int]:
    """Two different joints, counted from 0."""
    whole = isinstance(value, list | tuple) and all(type(index) is int and 0 <= index < 2**31 for index in value)
    if not whole or len(value) != 2 or value[0] == value[1]:
        raise expected("two different joints, counted from 0, as [0, 2]")
    return list(value)


class Output(Section):
    """``[output]``: the files to write, relative to the output folder; the data always, the rest on request.

    Attributes:
        data: the run, as netCDF; :meth:`pathcontrol.Run.load` reads it.
        html: the animation, one file for any browser.
        figure: the beginning of the names of the figures, SVG and PNG, and PDF if it ends so.
        figure_joints: the two joints in whose plane the path is drawn; by default those that move the most.
        summary: the metrics, as JSON.
    """

    data: Annotated[str, _file(".nc")] = "run.nc"
    html: Annotated[str, _file(".html")] | None = None
    figure: Annotated[str, _file("", ".svg", ".png", ".pdf")] | None = None
    figure_joints: Annotated[list[int], PlainValidator(_pair)] | None = None
    summary: Annotated[str, _file(".json")] | None = None


class Experiment(Section):
    """An experiment file: robot, task, controller, plant, loop, initial state and outputs.

    Attributes:
        duration: longest simulated time [s]; left out, a path that ends has twice its time by ϑ and 5 s more, each
            path of a toolpath for itself.
        laps: how many times a closed path is gone round; left out, as often as ``duration`` allows.
        engine: which engine runs the simulation, see :func:`pathcontrol.simulate`.
        angle_unit: of all angles and angular rates: ``lock``, the task's lengths, speeds and phases,
            ``start``, the Stribeck velocity and ``friction_width``. All else is in SI units, as gains are, or
            taken as it is, as ``task.parameters`` are.
        sweep: keys that vary, for :func:`run_sweep`; an experiment by itself does without.
        tune: keys that are searched, for :func:`run_tune`; likewise.
    """

    units: ClassVar[Units] = {"duration": "s"}
    angle_unit: Literal["rad", "deg"] = "rad"
    duration: Positive | None = None
    laps: Whole | None = None
    engine: Literal["auto", "compiled", "pinocchio"] = "auto"
    robot: Robot
    task: Task
    controller: Law
    start: Start = Start()
    plant: Plant = Plant()
    loop: Loop = SampledSection()
    output: Output = Output()
    sweep: SweepSection | None = None
    tune: TuneSection | None = None

    @property
    def to_radians(self) -> Callable[[float], float]:
        """Converts from ``angle_unit``."""
        return math.radians if self.angle_unit == "deg" else float
