"""The control law of a run, made again from its configuration, and the law's part in the record."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol._expect import expect
from pathcontrol.analysis.fitting_law import refuse_other_rows
from pathcontrol.analysis.metric_helpers import resolve_task
from pathcontrol.control.base import Controller, ControlOutput
from pathcontrol.errors import InputError
from pathcontrol.registry import LAWS
from pathcontrol.simulation.config import table
from pathcontrol.simulation.run import Run
from pathcontrol.simulation.summaries import is_whole
from pathcontrol.tasks.joined.path_sequence import PathSequence

_GIVE = "give controller=…, the law of the run"
_GIVEN = ("robot", "task", "options", "self")


class LawRecord(NamedTuple):
    """The law's part in a run of N rollouts at k samples, time first.

    Attributes:
        s: path parameter, (k, N).
        demand: torque that the law asks for [N m], (k, N, n).
        velocity: desired velocity wr(s) [rad/s], (k, N, n).
    """

    s: Array
    demand: Array
    velocity: Array


def find_law(run: Run, controller: Controller | None) -> Controller:
    """Return ``controller``, or by default the law of the run, made again from its configuration.

    A law that was wrapped is made without what wrapped it.

    Raises:
        InputError: the run does not say its law, its gains or its path, or follows several paths one after another.
    """
    if isinstance(run.task, PathSequence):
        raise InputError("the run follows a sequence of paths, each by a law of its own; take one, as run.path(0)")
    if controller is not None:
        expect("controller", controller, Controller)
        resolve_task(run, controller.task)
        refuse_other_rows(run, controller)
        return controller
    described = table(run.config, "controller")
    name = str(described.get("controller", "")).rstrip(")").rpartition("(")[2]
    make = LAWS.find(name) if name else None
    if make is None:
        raise InputError(
            f"the law of the run is {name or 'not known'!r}, which cannot be made again; {_GIVE}", value=name
        )
    try:
        law = make(run.model, resolve_task(run, None), **_select_rows(run, _select_arguments(make, described)))
    except TypeError as error:  # a law of one's own, which keeps its arguments under other names
        raise InputError(f"the law of the run, {name}, cannot be made again: {error}; {_GIVE}", value=name) from error
    expect("controller", law, Controller)
    return law


def record_of(run: Run, controller: Controller) -> LawRecord:
    """Return the law's part in a run: as recorded, or of a log without demands as the law would have acted on it."""
    if has_demand(run):
        velocity = run.array("e_v") + run.array("qd_measured" if "qd_measured" in run else "qd")
        return LawRecord(*(part.swapaxes(0, 1) for part in (run.array("s"), run.array("tau_demand"), velocity)))
    return replay(run, controller)


def has_demand(run: Run) -> bool:
    """Return whether a run says what torque its law asked for."""
    return "tau_demand" in run and not np.isnan(run.array("tau_demand")).all()


def replay(run: Run, controller: Controller) -> LawRecord:
    """Return the law's part along the motion of a log, as if it had been in the loop from the first sample on."""
    q, qd = (run.array(name).swapaxes(0, 1) for name in ("q", "qd"))
    walked = zip(_walk(run, controller, q, qd), qd, strict=True)
    found = [(out.s, out.tau, out.e_v + velocity) for (out, _), velocity in walked]
    return LawRecord(*(np.stack(parts) for parts in zip(*found, strict=True)))


def law_states(run: Run, controller: Controller | None = None) -> Array:
    """Return the state z of the law along a run, (rollout, time, m): σ first, and last what is the law's own.

    That is what :class:`AdaptiveSlotineLi` has learnt, or the speed of the flywheel of :class:`PassiveVelocityField`.
    A run does not keep it: the law is replayed on what it measured. It is exact for a sampled loop whose law has no
    observer, and of first order in the period of a log or of a run in continuous time.

    Args:
        run: the run.
        controller: the law; by default that of the run, by its configuration, if nothing wraps it.

    Raises:
        InputError: the law is not known, or was wrapped.
    """
    expect("run", run, Run)
    name = str(table(run.config, "controller").get("controller", ""))
    if controller is None and "(" in name:
        raise InputError(f"the law of the run is {name}, a law that is wrapped; {_GIVE}", value=name)
    law, measured = find_law(run, controller), "q_measured" in run and "qd_measured" in run
    q, qd = (run.array(f"{part}_measured" if measured else part).swapaxes(0, 1) for part in ("q", "qd"))
    return np.stack([z for _, z in _walk(run, law, q, qd)], axis=1)


def _walk(run: Run, controller: Controller, q: Array, qd: Array) -> Iterator[tuple[ControlOutput, Array]]:
    """Yield what a law gives along positions and velocities (k, N, n), and its state z there, (N, m)."""
    tau, periods = run.array("tau").swapaxes(0, 1), np.diff(run.time, append=np.nan)
    z = controller.start(run.array("q")[:, 0], run.array("qd")[:, 0])
    for t, period, position, velocity, torque in zip(run.time, periods, q, qd, tau, strict=True):
        out = controller.law(float(t), position, velocity, z)
        yield out, z
        if np.isfinite(period):
            z = controller.advance(z, out._replace(tau=torque), float(period))


def _select_rows(run: Run, arguments: dict[str, Any]) -> dict[str, Any]:
    """Return arguments with the gains of the rollouts that a run still has, where each has a row."""
    rows = run.array("rollout") - int(run.config.get("first_rollout") or 0)
    found = {}
    for name, value in arguments.items():
        array = np.asarray(value)
        own = array.ndim == 2 or (name == "k" and array.ndim == 1)
        if own and array.shape[0] != 1 and rows.max() >= len(array):
            raise InputError(
                f"{name} of the run has {len(array)} rows, it has a rollout {rows.max()}; {_GIVE}",
                argument=name,
                value=len(array),
            )
        found[name] = array[rows, None] if own and array.ndim == 1 else array[rows] if own and len(array) > 1 else value
    return found


def _select_arguments(make: Any, described: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a law that its description gives.

    Raises:
        InputError: gains are left out, or were too many to be kept.
    """
    found: dict[str, Any] = {}
    for cls in make.__mro__ if inspect.isclass(make) else [make]:
        if cls is not object and "__init__" in vars(cls):
            names = inspect.signature(vars(cls)["__init__"]).parameters
            found |= {name: described[name] for name in names if name in described and name not in _GIVEN}
    lacking = [name for name in make.gains if name not in found or not is_whole(found[name])]
    if lacking:
        raise InputError(
            f"the run does not say the gains {', '.join(lacking)} of its {make.__name__}; {_GIVE}",
            choices=tuple(lacking),
        )
    return found
