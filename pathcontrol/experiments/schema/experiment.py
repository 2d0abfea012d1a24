"""An experiment file as a model, whose import loads nothing heavy; :mod:`..builders` makes objects of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import PurePath
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PlainValidator

from pathcontrol.arguments import Form, Unit
from pathcontrol.experiments.schema.arm_sections import Plant, Robot
from pathcontrol.experiments.schema.derived import accept_several, make_chooser
from pathcontrol.experiments.schema.section import Section
from pathcontrol.experiments.schema.sweep_sections import Sweep, Tune
from pathcontrol.experiments.schema.task_sections import Task
from pathcontrol.experiments.schema.validators import Positive, Whole, check_forms, expected
from pathcontrol.registry import DISTURBANCES, LAWS, LOOPS


def _one_each(value: Any) -> Any:
    """Return numbers; a table by joint is refused where the names of the joints are known."""
    return value if isinstance(value, dict) else check_forms(Form.NUMBERS)(value)


ByJoint = Annotated[Any, PlainValidator(_one_each)]


class Start(Section):
    """``[start]``: the initial state, in ``angle_unit``; at rest at the beginning of the path by default."""

    q: Annotated[ByJoint | None, Unit("rad", "m")] = None
    qd: Annotated[ByJoint | None, Unit("rad/s", "m/s")] = None


class LoopSection(Section):
    """``[loop]``: how the loop is closed; ``target`` is the class of it."""

    mode: str = "sampled"
    target: ClassVar[Callable[..., Any]]


_LOOP = make_chooser(LOOPS, LoopSection, None, key="mode", default="sampled")


def _file(*suffixes: str) -> PlainValidator:
    """Return a validator of names of files below the output folder that end as the format asks."""
    wanted = " or ".join(suffix or "no suffix" for suffix in suffixes)

    def check(value: Any) -> str:
        path = PurePath(value) if isinstance(value, str) else PurePath()
        inside = path.name and not path.is_absolute() and ".." not in path.parts and "\0" not in str(path)
        if not inside or path.suffix not in suffixes:
            raise expected(f"a file name relative to the output folder, with {wanted}")
        return value

    return PlainValidator(check)


def _check_pair(value: Any) -> list[int]:
    """Check that a value is two different joints, counted from 0; return them."""
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
    figure_joints: Annotated[list[int], PlainValidator(_check_pair)] | None = None
    summary: Annotated[str, _file(".json")] | None = None


class Experiment(Section):
    """An experiment file: robot, task, controller, plant, loop, initial state and outputs.

    Attributes:
        duration: longest simulated time [s]; left out, a path that ends has twice its time by ϑ and 5 s more, each
            path of a toolpath for itself.
        laps: how many times a closed path is gone round; left out, as often as ``duration`` allows.
        until: ``"duration"`` to go on when the path has come to its end, see :func:`pathcontrol.simulate`.
        engine: which engine runs the simulation, see :func:`pathcontrol.simulate`.
        angle_unit: of all angles and angular rates, whose SI unit is rad, rad/s or rad/s². All else is in SI units, as
            gains are, or taken as it is, as formulas are.
        disturbance: what else pushes the simulated arm, or a list of such tables, which add up.
        sweep: keys that vary, for :func:`run_sweep`; an experiment by itself does without.
        tune: keys that are searched, for :func:`run_tune`; likewise.
    """

    angle_unit: Literal["rad", "deg"] = "rad"
    duration: Annotated[Positive | None, Unit("s")] = None
    laps: Whole | None = None
    until: Literal["end", "duration"] = "end"
    engine: Literal["auto", "compiled", "pinocchio"] = "auto"
    robot: Robot
    task: Task
    controller: Annotated[Any, PlainValidator(make_chooser(LAWS))]
    start: Start = Start()
    plant: Plant = Plant()
    loop: Annotated[Any, PlainValidator(_LOOP)] = Field(default_factory=lambda: _LOOP({}))
    disturbance: Annotated[Any, PlainValidator(accept_several(make_chooser(DISTURBANCES)))] | None = None
    output: Output = Output()
    sweep: Sweep | None = None
    tune: Tune | None = None

    @property
    def to_radians(self) -> Callable[[float], float]:
        """Converts from ``angle_unit``."""
        return math.radians if self.angle_unit == "deg" else float
