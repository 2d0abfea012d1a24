"""The comparison of laws in one scenario: same arm, same task, same starts, same seeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pathcontrol._arrays import Array, check_whole
from pathcontrol._expect import expect, expect_choice
from pathcontrol._json import to_json
from pathcontrol.analysis.progress import is_unfinished
from pathcontrol.analysis.readable import unit_of_joints
from pathcontrol.comparison.laws import Laws, make_laws
from pathcontrol.comparison.measures import MEASURES, measure
from pathcontrol.comparison.scenarios import Scenario, make_scenario
from pathcontrol.control.base import Controller
from pathcontrol.control.wrappers.paced import Paced
from pathcontrol.control.wrappers.speed_override import SpeedOverride
from pathcontrol.errors import SimulationError, warn
from pathcontrol.simulation.acting_limits import acting_limits
from pathcontrol.simulation.engines import Engine, check_engine
from pathcontrol.simulation.loops import torque_limits
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import make_plant
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.task import PathTask

_ROUNDING = 1e-7  # rad, m, N m, …
_BESIDE_OTHERS = 1e-6  # share of the largest mean
_ELSEWHERE = 1e-3  # rad, m: points of the path that are no other place for an event


@dataclass(frozen=True, eq=False)
class Comparison:
    """Laws in one scenario.

    Attributes:
        scenario: the scenario.
        laws: the laws by name.
        runs: the run of each law, with all rollouts.
        undisturbed: the run of each law in the undisturbed scenario, with the same starts.
        measures: for each law the measures by name, in SI units, (rollouts,) each.
    """

    scenario: Scenario
    laws: Mapping[str, Controller]
    runs: Mapping[str, Run]
    undisturbed: Mapping[str, Run]
    measures: Mapping[str, Mapping[str, Array]]

    def __repr__(self) -> str:
        means = ", ".join(f"{law} {self.mean(law, 'contour_peak'):.3g}" for law in self.measures)
        count, unit = next(iter(self.runs.values())).rollouts, self.units["contour_peak"]
        return f"Comparison({self.scenario.name}; rollout: {count}; contour_peak [{unit}]: {means})"

    @property
    def units(self) -> dict[str, str]:
        """The unit of each measure for the joints of the arm: rad becomes m, and N m becomes N, where they slide."""
        run = next(iter(self.runs.values()))
        return {name: unit_of_joints(unit, run) for name, unit in MEASURES.items()}

    @cached_property
    def stuck(self) -> dict[str, int]:
        """The laws whose arm did not get along the path even undisturbed, with the number of rollouts in which.

        An arm that stands still has the smallest errors, which say nothing.
        """
        counts = {law: int(is_unfinished(run).sum()) for law, run in self.undisturbed.items()}
        return {law: count for law, count in counts.items() if count}

    def mean(self, law: str, measure: str) -> float:
        """Return the mean of a measure over the rollouts; inf if one of them never recovers, NaN where none is one."""
        return _reduce(np.mean, self._values(law, measure))

    def spread(self, law: str, measure: str) -> float:
        """Return the standard deviation of a measure over the rollouts; NaN where the mean is no number."""
        return _reduce(np.std, self._values(law, measure))

    def best(self, measure: str) -> list[str]:
        """Return the laws whose mean of a measure is the least, within a thousandth; none where no mean is finite.

        Laws that are ``stuck`` are left out.
        """
        known = {law: size for law, size in self._sizes(measure).items() if law not in self.stuck}
        least = min(known.values(), default=0.0)
        return [law for law, value in known.items() if value <= max(1.001 * least, self.rounding(measure))]

    def rounding(self, measure: str) -> float:
        """Return the size below which a measure is 0 but for rounding, in SI units.

        That is a millionth of the largest mean of all laws, or what a nearest point is known to if that is more: √ε of
        a path of some radians.
        """
        return max(_ROUNDING, _BESIDE_OTHERS * max(self._sizes(measure).values(), default=0.0))

    def _values(self, law: str, measure: str) -> Array:
        """Return the values of a measure, (rollouts,)."""
        expect_choice("law", law, list(self.measures))
        expect_choice("measure", measure, list(self.measures[law]))
        return self.measures[law][measure]

    def _sizes(self, measure: str) -> dict[str, float]:
        """Return the sizes of those means of a measure that are finite, by law."""
        means = {law: self.mean(law, measure) for law in self.measures}
        return {law: abs(mean) for law, mean in means.items() if np.isfinite(mean)}

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold: means by law and measure, ``spread``, ``rollouts`` and units; null for no number.

        ``stuck`` is the number of rollouts that did not get along the path even undisturbed. All is in SI units.
        """
        scenario = self.scenario
        return {
            "scenario": scenario.name,
            "sentence": scenario.sentence,
            "duration": scenario.duration,
            "event": to_json(scenario.event),
            "window": list(scenario.window),
            "units": self.units,
            "controllers": {law: self._law_to_dict(law) for law in self.measures},
        }

    def _law_to_dict(self, law: str) -> dict[str, Any]:
        """Return the numbers of one law."""
        values = self.measures[law]
        gains = {name: np.asarray(getattr(self.laws[law], name)).tolist() for name in self.laws[law].gains}
        return to_json({name: self.mean(law, name) for name in values}) | {
            "spread": to_json({name: self.spread(law, name) for name in values}),
            "rollouts": to_json(values),
            "stuck": self.stuck.get(law, 0),
            "diverged": int((self.runs[law].status == "diverged").sum()),
            "gains": gains,
        }


def compare(
    laws: Laws | None = None,
    scenario: str | Scenario = "jammed-joint",
    *,
    rollouts: int = 16,
    seed: int = 0,
    engine: Engine | None = None,
    progress: bool = True,
) -> Comparison:
    """Compare control laws in one scenario: same arm, task, plant, loop, starts and seeds, gains that mean the same.

    The known laws are ``"computed_torque"``, ``"pd_plus"``, ``"slotine_li"``, ``"extended_motion_plan"`` and
    ``"projection"``. Computed torque has K_p and K_v of the path laws. PD+ has diag M(q̄)K_p and diag M(q̄)K_v, the
    same stiffness and damping at the mean posture q̄ of the path. Slotine and Li's law has ΛD = K_p and Λ + D = K_v with
    K_d = diag M(q̄)D, or Λ = D = √K_p where K_v² < 4K_p, as it cannot damp less than critically. On a closed path all of
    them begin at the point nearest to the arm. The same numbers come out for a rollout alone and among others.

    ``"all"`` adds the laws of other sources, which may be named too: ``"adaptive_slotine_li"`` has the gains of Slotine
    and Li's law, the plan of the extended motion plan, and an adaptation of 0.001 1/J;
    ``"passive_velocity_field"`` has ΛK_v = K_p and Λ + K_v = K_v of these, or Λ = K_v = √K_p, means of all joints,
    and a recharge of 10 1/s; ``"transverse_linearization"`` has the means of K_p and K_v, and k_s = k_v;
    ``"maneuver_regulation"`` has K_p and K_v.

    The measures, of the event and the time after it (without one of the second half of a closed path, or of a whole
    open one), in SI units, with m for rad and N for N m where joints slide:

    - ``contour_peak``, ``contour_rms``: distance to the nearest point of the path [rad].
    - ``lag_peak``: largest component along the path of q_d(s) − q [rad], s of the law. It is nearly 0 for projection
      that sees where the arm is.
    - ``speed_peak``: largest ‖q̇‖ [rad/s].
    - ``torque_peak``: largest torque that acted, of all joints [N m].
    - ``recovery_s``: time after the end of the event until the contour error stays below 1.1 times its own undisturbed
      peak [s]; inf where it does not, NaN where no event ends.
    - ``time_lost_s``: path parameter behind that of the undisturbed run at the end, over ϑ [s]. It is 0 for motion
      control, whose s waits for nobody but for ticks that are missed; what that costs are contour error and lag.
    - ``energy_j``: ∫|τ·q̇| dt [J], with the torque that is held in each period.
    - ``saturated_s``: time with any torque at its limit [s], as a :class:`TorqueLimitDrop` leaves it; 0 in a loop
      without limits.

    Args:
        laws: names of known laws, laws for ``scenario.robot`` and ``scenario.task``, or functions (robot, task) that
            make one; one, several, or by names of your own. A warning tells which begin elsewhere than the known ones.
            By default the five known ones and those of the scenario, ``"all"`` for those of other sources too, also
            beside other laws.
        scenario: a name of :func:`known_scenarios`, or a :class:`Scenario`.
        rollouts: how many starts: that of the scenario, and others near the path, see :meth:`Scenario.starts`.
        seed: of these starts.
        engine: as for :func:`simulate`, by default the scenario's.
        progress: show a bar on standard error when a run takes longer than two seconds.

    Raises:
        InputError: a law does not fit the scenario, or an argument is something else.
        UnknownNameError: there is no such law or scenario.
    """
    rollouts, seed = check_whole("rollouts", rollouts), check_whole("seed", seed, 0)
    if isinstance(scenario, str):
        scenario = make_scenario(scenario)
    expect("scenario", scenario, Scenario)
    made = make_laws(laws, scenario.robot, scenario.task, scenario.gains, scenario.laws, scenario.pattern)
    if engine is not None:
        check_engine(engine)
    starts = scenario.starts(rollouts, seed)
    calm = scenario.calm
    runs = {name: _run(law, scenario, starts, engine, progress) for name, law in made.items()}
    _warn_of_starts(runs, scenario.task, starts)
    others = runs if calm is scenario else {n: _run(law, calm, starts, engine, progress) for n, law in made.items()}
    end = None if scenario.event is None or scenario.event[1] >= scenario.duration else scenario.event[1]
    measures = {name: _measure(law, runs[name], others[name], scenario, end) for name, law in made.items()}
    return Comparison(scenario, made, runs, others, measures)


def _warn_of_starts(runs: Mapping[str, Run], task: PathTask, starts: Array) -> None:
    """Warn of laws that began at s0 where another point is nearer, so that an event caught them at another place."""
    if not task.closed:
        return
    away = np.abs(task.q_d(np.array(task.s0)) - task.q_d(task.sigma_bar(starts))).max()
    elsewhere = [repr(name) for name, run in runs.items() if (run.array("s")[:, 0] == task.s0).all()]
    if elsewhere and away > _ELSEWHERE:
        warn(
            f"{', '.join(elsewhere)} of this comparison began at s0 of the closed path, wherever the arm was, and the "
            "known laws at the nearest point, so that an event caught them at other places; make it with "
            "start='nearest'"
        )


def _measure(law: Controller, run: Run, calm: Run, scenario: Scenario, event_end: float | None) -> dict[str, Array]:
    """Return the measures of the run of one law."""
    limits = torque_limits(scenario.loop, make_plant(scenario.plant, law))
    return measure(run, calm, scenario.window, event_end, acting_limits(limits, scenario.disturbance, run.time))


def _run(law: Controller, scenario: Scenario, starts: Array, engine: Engine | None, progress: bool) -> Run:
    """Return the run of one law; where all rollouts diverged, what happened until then."""
    if isinstance(law, Paced) and not np.any(scenario.loop.torque_limits):  # nothing is there to be paced by
        law = law.wrapped
    if scenario.override is not None:
        law = SpeedOverride(law, scenario.override, scenario.acceleration)
    try:
        return simulate(
            law,
            starts,
            duration=scenario.duration,
            until="duration",
            plant=scenario.plant,
            loop=scenario.loop,
            disturbance=scenario.disturbance,
            engine=scenario.engine if engine is None else engine,
            progress=progress,
        )
    except SimulationError as error:
        if error.run is None:
            raise
        run: Run = error.run
        return run


def _reduce(function: Any, values: Array) -> float:
    """Return a statistic of values; what is infinite makes the mean infinite, and the spread NaN."""
    with np.errstate(invalid="ignore"):
        return float(function(values))
