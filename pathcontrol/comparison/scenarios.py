"""Situations in which laws are compared: a task, an arm that may differ from its model, and what happens to it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, as_array, as_joint_vector, as_scalar
from pathcontrol._expect import did_you_mean, expect
from pathcontrol.comparison.event import find_event
from pathcontrol.comparison.laws import PACED_LAWS, Law
from pathcontrol.comparison.paper import DURATION, K_P, K_V, PERIOD, START_DEG, K, paper_task
from pathcontrol.comparison.shared_gains import Gains, make_gains
from pathcontrol.control.base import Controller
from pathcontrol.control.extended_motion_plan import ExtendedMotionPlan
from pathcontrol.control.wrappers.override_rule import Override
from pathcontrol.errors import InputError, UnknownNameError
from pathcontrol.robot.loading import load_robot
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.arm.dropout import Dropout
from pathcontrol.simulation.arm.jam import JammedJoint
from pathcontrol.simulation.arm.noise import SensorNoise
from pathcontrol.simulation.arm.wall import Wall
from pathcontrol.simulation.engines import Engine, check_engine
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.run_arguments import check_loop
from pathcontrol.tasks.curves import Circle
from pathcontrol.tasks.task import PathTask

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
_NEAR = 0.05  # rad, standard deviation of initial postures from the path
_JAM = (4.0, 4.6)  # s
_WALL, _WALL_AT = (4.0, 7.2), 0.7  # s, m: longer than a lap, across a path that reaches 0.795 m
_LOST = (4.0, 4.1)  # s
_HOLD = (4.0, 6.0)  # s
_FAST = 11.0  # rad/s; a lap takes 0.571 s, of which the motors need 0.673 s at least
_HEAVIER = 1.3


#: the kinds of some arguments of a scenario
_KINDS: dict[str, type] = {
    "robot": RobotModel,
    "task": PathTask,
    "disturbance": Disturbance,
    "laws": Mapping,
    "pattern": Controller,
}


class _FoundEvent(tuple[float, float]):
    """An event that nobody gave, which ``replace`` finds anew."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """A situation in which laws are compared, and the same one undisturbed.

    Attributes:
        name: its name.
        sentence: what happens, in one sentence.
        robot: the model of the arm that all laws know.
        task: path and velocity profile.
        q: initial posture [rad] of the first rollout, (n,), which begins at rest.
        duration: simulated time [s].
        loop: how the loop is closed.
        plant: the simulated arm, by default ``robot``.
        disturbance: what else acts on the arm, or ``None``.
        event: from when to when something happens [s], by default when the disturbances and the operator act that have
            a time; ``None`` where none has.
        gains: K_p [1/s²], K_v [1/s] and k [1/(rad² s)] of all laws, as a table by these names; k may be left out.
        override: an operator's input to the speed of all laws, as for :class:`SpeedOverride`, or ``None``.
        acceleration: largest rate of the factor of the speed that follows it [1/s], or ``None`` for what motors allow.
        engine: which engine runs it, see :func:`simulate`.
        undisturbed: the scenario without what happens in it, by default without its disturbance and its override. It is
            run for ``duration``, too.
        laws: laws beside the known ones, by name: names of others, or functions of arm and task.
        pattern: a law whose ``friction`` and ``observer_hz``, and ``start`` on an open path, all known laws have; the
            one of its own kind is that law itself. By default they have those of their classes, and on a closed path
            they begin at the nearest point.

    Raises:
        InputError: an argument is something else, the event does not begin within the run, or the undisturbed one has
            samples at other times.
    """

    name: str
    sentence: str
    robot: RobotModel
    task: PathTask
    q: Array
    duration: float
    loop: SampledLoop | ContinuousTime = field(default_factory=SampledLoop)
    plant: RobotModel | None = None
    disturbance: Disturbance | None = None
    event: tuple[float, float] | None = None
    gains: Gains = field(default_factory=Gains)
    override: Override | None = None
    acceleration: float | None = None
    engine: Engine = "auto"
    undisturbed: Scenario | None = None
    laws: Mapping[str, Law] = field(default_factory=dict)
    pattern: Controller | None = None

    def __post_init__(self) -> None:
        for name, kind in _KINDS.items():
            if (value := getattr(self, name)) is not None or name in ("robot", "task"):
                expect(name, value, kind)
        made = {
            "q": as_joint_vector("q", self.q, self.robot.n),
            "duration": as_scalar("duration", self.duration, positive=True),
            "loop": check_loop(self.loop),
            "gains": make_gains(self.gains),
        }
        for name, value in made.items():
            object.__setattr__(self, name, value)
        check_engine(self.engine)
        object.__setattr__(self, "event", self._find_event())
        if self.undisturbed is not None:
            self._check_undisturbed(self.undisturbed)

    def _check_undisturbed(self, undisturbed: Any) -> None:
        """Check that the undisturbed scenario is one, and has samples at the same times."""
        expect("undisturbed", undisturbed, Scenario)
        if (own := _sampling(self.loop)) != (other := _sampling(undisturbed.loop)):
            raise InputError(
                f"undisturbed.loop has samples each {other:g} s and loop each {own:g} s, expected the same times",
                argument="undisturbed",
                value=other,
                limit=own,
            )

    def _find_event(self) -> tuple[float, float] | None:
        """Return the event that is given, or else that of disturbance and override."""
        event, found = self.event, self.event is None or isinstance(self.event, _FoundEvent)
        if found:
            event = find_event(self.disturbance, self.duration, self.override)
        if event is None:
            return None
        times = as_array("event", event)
        if times.shape != (2,) or not 0 <= times[0] < min(times[1], self.duration):
            remedy = "; start disturbance and override earlier, or give a longer duration" if found else ""
            raise InputError(
                f"event = {event}, expected begin and end [s] with a begin in the run of {self.duration:g} s{remedy}",
                argument="event",
                value=event,
                limit=(0.0, self.duration),
            )
        return (_FoundEvent if found else tuple)(times.tolist())

    @property
    def calm(self) -> Scenario:
        """The undisturbed scenario for the same time; itself where nothing happens."""
        if self.undisturbed is not None:
            return replace(self.undisturbed, duration=self.duration)
        if self.disturbance is None and self.override is None:
            return self
        return replace(self, disturbance=None, override=None)

    @property
    def window(self) -> tuple[float, float]:
        """The time that counts [s]: from the event on; without one the second half, on an open path all of the run."""
        begin = 0.5 * self.duration if self.task.closed else 0.0
        return (begin if self.event is None else self.event[0], self.duration)

    def starts(self, rollouts: int, seed: int) -> Array:
        """Return initial postures [rad], (rollouts, n): :attr:`q`, and others near the path.

        Those are at points that cover a closed path evenly, whatever their number, or at the begin of an open one, plus
        a normal deviate of 0.05 rad in each joint. Rollout i has the same posture alone and among others. The points
        are the fractions of multiples of the golden ratio, moved along by a number that the seed draws.
        """
        moved = np.random.default_rng(seed).uniform()
        others = [self._near(moved + i * _GOLDEN, np.random.default_rng([seed, i])) for i in range(1, rollouts)]
        return np.stack([self.q, *others])

    def _near(self, share: float, random: np.random.Generator) -> Array:
        """Return a posture near the path, (n,), at a ``share`` of the length in s of a closed one."""
        begin, end = self.task.one_traverse if self.task.closed else (self.task.s0, self.task.s0)
        s = begin + (share % 1.0) * (end - begin)
        return np.asarray(self.task.q_d(np.array(s)) + random.normal(0.0, _NEAR, self.robot.n))


def _sampling(loop: SampledLoop | ContinuousTime) -> float:
    """Return the time between recorded samples [s]."""
    return loop.period if isinstance(loop, SampledLoop) else loop.output_period


def known_scenarios() -> dict[str, str]:
    """Return what happens in each scenario of the library, a sentence by its name."""
    return {name: sentence for name, (sentence, _) in _SCENARIOS.items()}


def make_scenario(name: str) -> Scenario:
    """Return a scenario of the library by its name.

    Raises:
        UnknownNameError: there is none of this name.
    """
    if not isinstance(name, str) or name not in _SCENARIOS:
        choices = tuple(_SCENARIOS)
        raise UnknownNameError(
            f"there is no scenario {name!r}, expected one of {', '.join(choices)}{_advise(name)}",
            argument="scenario",
            value=name,
            choices=choices,
        )
    sentence, change = _SCENARIOS[name]
    return change(_paper(name, sentence))


def _advise(name: Any) -> str:
    """Return what to try in place of an unknown name."""
    if str(name).endswith(".toml"):
        return f"; load_scenario({str(name)!r}) makes one of an experiment file"
    return did_you_mean(name, _SCENARIOS)


def _paper(name: str, sentence: str) -> Scenario:
    """Return the paper's experiment with exact sensors."""
    return Scenario(
        name=name,
        sentence=sentence,
        robot=load_robot("cicese_2dof"),
        task=paper_task(),
        q=np.deg2rad(START_DEG),
        duration=DURATION,
        loop=SampledLoop(period=PERIOD, torque_limits=True),
        gains=Gains(K_P, K_V, K),
    )


def _jam(calm: Scenario) -> Scenario:
    """Return the scenario with joint 2 held for a while."""
    return replace(calm, disturbance=JammedJoint(1, _JAM[0], _JAM[1] - _JAM[0]))


def _meet_wall(calm: Scenario) -> Scenario:
    """Return the scenario with a wall across the path for a while, and a plan that hardly waits for the arm."""
    wall = Wall(
        "tool",
        [_WALL_AT, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        rigid=True,
        friction=0.2,
        start=_WALL[0],
        duration=_WALL[1] - _WALL[0],
    )
    return replace(calm, disturbance=wall, laws={"plan_small_k": _plan_with_small_k})


def _plan_with_small_k(robot: RobotModel, task: PathTask) -> Controller:
    """Return the paper's plan with a twentieth of its k."""
    return ExtendedMotionPlan(robot, task, K_P, K_V, K / 20.0, start="nearest")


def _lose_measurements(calm: Scenario) -> Scenario:
    """Return the scenario in which the law sees the same measurement for a while."""
    return replace(calm, disturbance=Dropout(_LOST[0], _LOST[1] - _LOST[0], "measurements"))


def _weaken(calm: Scenario) -> Scenario:
    """Return the scenario at a speed that the motors cannot keep, from a start on the path."""
    task = Circle(1.0, _FAST)
    paced = {name: name for name in PACED_LAWS}
    fast = replace(calm, task=task, q=task.q_d(np.array(task.s0)), laws=paced)
    return replace(fast, undisturbed=replace(fast, loop=SampledLoop(period=PERIOD)))


def _hold(calm: Scenario) -> Scenario:
    """Return the scenario with an operator who holds all plans for a while."""
    return replace(calm, override=[[_HOLD[0], 0.0], [_HOLD[1], 1.0]])


def _load(calm: Scenario) -> Scenario:
    """Return the scenario with a heavier link 2."""
    heavier = calm.robot.with_masses({calm.robot.joint_names[1]: _HEAVIER})
    return replace(calm, plant=heavier, undisturbed=calm)


def _measure_badly(calm: Scenario) -> Scenario:
    """Return the scenario with the sensors and the delay of a real loop."""
    noise = SensorNoise(position=1e-4, seed=1)
    loop = SampledLoop(PERIOD, encoders=True, velocity="difference", torque_limits=True, delay=PERIOD, noise=noise)
    return replace(calm, loop=loop, undisturbed=calm)


_SCENARIOS: dict[str, tuple[str, Callable[[Scenario], Scenario]]] = {
    "undisturbed": ("The paper's circle at 2 rad/s with exact sensors; nothing happens.", lambda calm: calm),
    "jammed-joint": ("Joint 2 is held still from 4.0 to 4.6 s and let go.", _jam),
    "wall": ("A rigid wall stands across the path of the tool from 4.0 to 7.2 s.", _meet_wall),
    "dropout": ("No measurement comes to the law from 4.0 to 4.1 s.", _lose_measurements),
    "weak-motors": ("The circle is to be followed at 11 rad/s, which the motors cannot do.", _weaken),
    "hold": ("An operator holds the plan from 4.0 to 6.0 s and lets it go on.", _hold),
    "payload": ("Link 2 is 30 % heavier than the laws know.", _load),
    "noisy-loop": ("Encoders, noise of 0.1 mrad, velocity by differences, and a delay of 2.5 ms.", _measure_badly),
}
