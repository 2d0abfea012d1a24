"""The simulation of a control law: one call from a controller and an initial state to a :class:`Run`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import as_scalar, check_whole
from pathcontrol.control.base import Controller, check_controller
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.acting_limits import record_limits
from pathcontrol.simulation.arm.disturbance import Disturbance
from pathcontrol.simulation.checks.slips import warn_if_still
from pathcontrol.simulation.engines import Engine, check_engine
from pathcontrol.simulation.finish import Until, count_laps, first_and_last, make_finish
from pathcontrol.simulation.loops import ContinuousTime, Outside, SampledLoop
from pathcontrol.simulation.prepare import prepare
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.run_arguments import (
    broadcast_states,
    check_joints,
    check_length,
    check_loop,
    make_config,
    make_plant,
    map_position_units,
    sample_period,
    start_law,
)


def simulate(
    controller: Controller,
    q: ArrayLike,
    qd: ArrayLike | None = None,
    *,
    duration: float,
    laps: int | None = None,
    until: Until = "end",
    plant: RobotModel | Sequence[RobotModel] | None = None,
    loop: SampledLoop | ContinuousTime | None = None,
    disturbance: Disturbance | None = None,
    first_rollout: int = 0,
    engine: Engine = "auto",
    progress: bool = True,
) -> Run:
    """Simulate a control law on an arm.

    The run ends when all rollouts are finished, or after ``duration``. On an open path a rollout is finished when its
    plan has 0.1 mrad of the path left at most and the arm is at rest, ‖q̇‖ ≤ 0.01 rad/s, for 50 ms; it is held there
    while others go on. On a closed path it is finished after ``laps``, and goes on moving; without ``laps`` never.

    A rollout diverges when its state is no number or beyond 10⁶ rad or rad/s, or its law asks for torques that are no
    numbers. It has the status ``"diverged"``, a ``diverged_time`` and a ``reason``; from that time on all that is
    recorded of it is NaN (and ``regular`` False). In a sampled loop the others are to the last bit what they would be
    without it; in continuous time they share the steps of one integrator, and agree within its tolerance.

    Args:
        controller: the law, with its own model of the arm, and one task for all rollouts or a :class:`TaskBatch`.
        q: initial joint positions [rad], (n,) or a batch (*batch, n); the run counts batches as rollouts. One state
            does for all rollouts of which plants, tasks, gains or the disturbance say how many there are.
        qd: initial joint velocities [rad/s], broadcast against ``q``; default at rest.
        duration: longest simulated time [s], rounded to whole periods of the loop, one at least.
        laps: how many times a closed path is gone round, counted from where its plan starts.
        until: ``"end"`` as said above, or ``"duration"`` to go on to the end of ``duration`` in any case.
        plant: the simulated arm with its friction; default the controller's own model. Or one for each
            rollout, in the order of ``q``, with the same joints: see :class:`RobotBatch`. An arm whose friction has
            coefficients (N, n) is one for each rollout too.
        loop: how the loop is closed; default ``SampledLoop()``, a 2.5 ms hold and nothing else.
        disturbance: a disturbance of the arm, such as :class:`Push`, or a sum; its time counts from the start.
        first_rollout: number of the first rollout, where this is a part of a larger batch: rollouts are numbered from
            it, and their random numbers depend on their numbers.
        engine: ``"pinocchio"`` (NumPy and Pinocchio, the reference), ``"compiled"``, or ``"auto"``: compiled where that
            can be, else the reference. ``run.config`` says which it was, and why not the compiled one.
        progress: show a bar on standard error when it takes longer than two seconds.

    A start or a path outside position limits, an arm that cannot hold its own weight, and one that never moved, held by
    its friction, are told by a :class:`PathControlWarning`; so are periods too long for the gains, with the largest
    usable k of an extended motion plan where its own is beyond it, and steps of the
    plant too long for what is fast in it, with the number of ``substeps`` to take.

    Raises:
        EngineError: the engine is to be the compiled one, and something of the run is beyond it.
        InputError: an argument has the wrong shape or value.
        SimulationError: all rollouts diverged, as a single one does; its ``run`` holds what happened until then.
    """
    check_controller("controller", controller)
    check_engine(engine)
    duration = as_scalar("duration", duration, positive=True)
    robot, first = make_plant(plant, controller), check_whole("first_rollout", first_rollout, 0)
    check_joints(controller, robot)
    loop = check_loop(loop)
    q0, qd0, z0 = start_law(controller, *broadcast_states(q, qd, robot, controller.task), disturbance)
    period, finish = sample_period(loop, duration), make_finish(controller.task, laps, until, len(q0))
    check_length(duration, loop, len(q0), robot.n, finish is not None and finish.ends_run)
    settings = {"duration": duration, "laps": laps, "until": until, "first_rollout": first}
    ready = prepare([controller], controller.task, robot, loop, q0, qd0, Outside(disturbance, first), duration, engine)
    config = make_config(controller.describe(), robot, loop, disturbance, **settings, **ready.engine)
    arm = ready.arm
    arrays = arm.run(controller, duration, finish, progress, z0)
    arm.divergence.explain(ready.advice)
    outcome = arm.divergence.outcome() | arm.law_outcome | ({} if finish is None else {"finish_time": finish.time})
    if controller.task.closed:
        outcome["laps"] = count_laps(controller.task, *first_and_last(arrays["s"]))
    time = period * np.arange(arrays["s"].shape[1])
    arrays = arrays | record_limits(arrays, time, loop, robot, disturbance)
    run = Run.from_arrays(
        time,
        map_position_units(robot),
        arrays,
        config,
        outcome,
        robot=robot,
        task=controller.task,
        model=controller.robot,
        first_rollout=first,
    )
    arm.divergence.check(run)
    if not first:
        warn_if_still(run, robot, controller)
    return run
