"""The choice of the engine of a simulation: the compiled one if possible, else the reference on NumPy and Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Literal, NamedTuple, get_args

from pathcontrol._arrays import Array
from pathcontrol._expect import expect_choice
from pathcontrol.control.base import Controller
from pathcontrol.engine.library import load_library
from pathcontrol.errors import EngineError, warn
from pathcontrol.simulation.arm.disturbance import list_terms
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.compiled import CompiledArm
from pathcontrol.simulation.compiled_disturbances import check_walls
from pathcontrol.simulation.compiled_plant import CompiledPlant
from pathcontrol.simulation.continuous import ContinuousArm
from pathcontrol.simulation.loops import Arm, ContinuousTime, Outside, SampledLoop
from pathcontrol.simulation.sampled import SampledArm

Engine = Literal["auto", "compiled", "pinocchio"]


class Choice(NamedTuple):
    """The chosen arm, and the entries about it in ``run.config``.

    Attributes:
        arm: the simulated arm behind its sensors and actuators.
        config: ``engine``, and ``engine_reason`` where it is not the compiled one.
    """

    arm: SampledArm | CompiledArm | ContinuousArm
    config: dict[str, str]


def check_engine(engine: str) -> None:
    """Check that ``engine`` is one of the choices.

    Raises:
        UnknownNameError: it is not.
    """
    expect_choice("engine", engine, get_args(Engine))


def settle_engine(engine: Engine) -> Engine:
    """Return the engine for a study of many simulations: never ``"auto"`` where there is no compiled one.

    A study that is resumed elsewhere can then tell that the engine has changed.
    """
    check_engine(engine)
    if engine != "auto":
        return engine
    try:
        load_library()
    except EngineError as error:
        _warn_once(str(error))
        return "pinocchio"
    return "auto"


def choose_engine(
    engine: str,
    controllers: Sequence[Controller],
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    q: Array,
    qd: Array,
    outside: Outside,
) -> Choice:
    """Return the arm (N, n) that is to run all ``controllers``.

    Raises:
        EngineError: ``engine`` is ``"compiled"`` and something of the run is beyond the compiled engine.
        InputError: a setting of the loop does not fit the rollouts.
    """
    reason = "asked for"
    if engine != "pinocchio":
        try:
            return _compile(controllers, loop, robot, q, qd, outside)
        except EngineError as error:
            if engine == "compiled":
                raise
            reason = str(error)
    arm: SampledArm | ContinuousArm
    if isinstance(loop, SampledLoop):
        arm = SampledArm(loop, robot, q, qd, outside)
    else:
        arm = ContinuousArm(loop, robot, q, qd, outside)
    return Choice(arm, {"engine": "pinocchio", "engine_reason": reason})


def _compile(
    controllers: Sequence[Controller],
    loop: SampledLoop | ContinuousTime,
    robot: Arm,
    q: Array,
    qd: Array,
    outside: Outside,
) -> Choice:
    """Compile the whole loop, or only the plant where a law or a disturbance is in Python."""
    if not isinstance(loop, SampledLoop):
        raise EngineError("continuous time is integrated by SciPy")
    try:
        load_library()
    except EngineError as error:
        _warn_once(str(error))
        raise
    try:
        return Choice(CompiledArm(loop, robot, q, qd, outside, controllers), {"engine": "compiled"})
    except EngineError as error:
        check_walls([term for term in list_terms(outside.disturbance) if isinstance(term, Wall)])
        arm = SampledArm(loop, robot, q, qd, outside, CompiledPlant)
        return Choice(arm, {"engine": "compiled", "engine_reason": f"only the plant is compiled: {error}"})


@cache
def _warn_once(message: str) -> None:
    """Warn with ``message``, once in a process."""
    warn(message)
