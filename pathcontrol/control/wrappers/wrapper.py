"""Laws around another law, which choose the speed along its path."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import Array, as_joint_array, join_columns
from pathcontrol.control.base import Controller, ControlOutput, check_controller
from pathcontrol.control.learning.learning_law import LearningLaw
from pathcontrol.control.observer import CUTOFF
from pathcontrol.control.wrappers.override_rule import Override, OverrideRule
from pathcontrol.control.wrappers.speed_rule import Moment, Speed, SpeedRule
from pathcontrol.errors import InputError

_LATER = 1e3  # s, by when a law of one's own that waits at first goes by its speed


class LawWrapper(Controller):
    """A law that goes along its path at a factor w(t) of the speed, chosen by rules.

    The law inside is asked with the profile wϑ in place of ϑ, by :meth:`Controller.at_speed`, and M(q)q_d'ϑẇ is added
    to its torque. With r = q_d'ϑ its velocity error is then e_v = wr − q̇, its acceleration d(wr)/dt = wr'σ̇ + ẇr,
    and the plan of the extended motion plan σ̇ = wϑ(σ) − k e_pᵀq_d'. Both theorems hold as they are for any w(t)
    that is differentiable, of any sign: that of the extended motion plan asks for k(σ) ≥ 0, that of the projection for
    e_p ⊥ r, and neither asks for more of w.

    Each rule makes of the speed that is asked for (first that of the profile, w = 1) the speed that is taken. A wrapper
    around a wrapper adds its rule to those inside, after them or, where they are ``last``, before them. The state z is
    that of the law inside, then those of the rules in their order.

    Any :class:`Controller` can be wrapped that asks :meth:`Controller.point` for its task and that is to accelerate the
    arm as its plan does.

    Args:
        law: the law inside.
        rule: the rule that is added, or ``None``.

    Attributes:
        wrapped: the law, as given.
        rule: the rule, as given.
        inner: the innermost law.
        rules: all rules, in the order in which they are asked.
    """

    def __init__(self, law: Controller, rule: SpeedRule | None = None) -> None:
        check_controller("law", law)
        self.wrapped, self.rule = law, rule
        known = law.rules if isinstance(law, LawWrapper) else ()
        rules = sorted((*known, *([] if rule is None else [rule])), key=lambda one: one.last)
        has_operator = any(isinstance(one, OverrideRule) for one in rules)
        self.rules: tuple[SpeedRule, ...] = tuple(rules if has_operator else [OverrideRule(), *rules])
        self.inner: Controller = law.inner if isinstance(law, LawWrapper) else law
        inner = self.inner
        self.robot, self.task, self.friction, self.start_at = inner.robot, inner.task, inner.friction, inner.start_at
        self.ending, self._viscous, self.gains = inner.ending, inner._viscous, inner.gains
        self.observer, self.observer_hz = inner.observer, inner.observer_hz
        for name in inner.gains:
            setattr(self, name, getattr(inner, name))

    def around(self, law: Controller) -> Self:
        """Return this wrapper, with its rule, around another ``law`` for the same arm and task."""
        wrapper = copy(self)
        LawWrapper.__init__(wrapper, law, self.rule)
        return wrapper

    def watching(self, observer_hz: ArrayLike = CUTOFF) -> Self:
        """Return this wrapper around its law with a momentum observer; see :meth:`Controller.watching`."""
        wrapper = copy(self)
        wrapper.inner = self.inner.watching(observer_hz)
        wrapper.observer = wrapper.inner.observer
        return wrapper

    # --- the operator ---------------------------------------------------------------------------------------

    def hold(self) -> None:
        """Let the plan come to rest on its path and stay there, within the acceleration bound."""
        self._operator.hold()

    def resume(self) -> None:
        """Let the plan go forward again, after :meth:`hold` or :meth:`reverse`, at the override."""
        self._operator.resume()

    def override(self, value: Override) -> None:
        """Set the override u, 0 to 2: how fast the plan goes when it is not held, as a factor of its profile.

        Held, it stays held. A function of time t [s], or steps [[t, u], …], may go back by u < 0.

        Raises:
            InputError: u is not from −2 to 2.
        """
        self._operator.override(value)

    def reverse(self) -> None:
        """Let the plan go back along its path at the override; an open path ends at its begin."""
        self._operator.reverse()

    def apart(self) -> Self:
        """Return this wrapper for a loop, which has the same buttons and can be stopped beside them."""
        wrapper, operator = copy(self), self._operator
        wrapper.rules = tuple(operator.apart() if rule is operator else rule for rule in self.rules)
        return wrapper

    def stop(self) -> None:
        """Let the plan come to rest whatever the operator asks for, until :meth:`go`, see :meth:`apart`."""
        self._operator.stop()

    def go(self) -> None:
        """Let the plan do what the operator asks for."""
        self._operator.go()

    @property
    def _operator(self) -> OverrideRule:
        """The outermost speed input."""
        return next(rule for rule in reversed(self.rules) if isinstance(rule, OverrideRule))

    # --- the law --------------------------------------------------------------------------------------------

    def start(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return the state z of the law inside and of all rules, (*batch, m), for an arm that starts at (q, q̇).

        Raises:
            InputError: the law inside does not go by the speed that it is given.
        """
        position, velocity = self._repeat(*self._arm_state(q, qd))
        own = self.inner.start(position, velocity)
        self._check_listens(position, velocity, own)
        position, velocity = (np.broadcast_to(one, (*own.shape[:-1], self.robot.n)) for one in (position, velocity))
        parts, asked = [own], np.ones(own.shape[:-1])
        for rule in self.rules:
            x = rule.start(self.inner, position, velocity, own[..., 0])
            if rule.relative:
                x = join_columns([(asked * x[..., 0])[..., None], x[..., 1:]])
            parts.append(x)
            asked = x[..., 0]
        return join_columns(parts)

    def _arm_state(self, q: ArrayLike, qd: ArrayLike) -> tuple[Array, Array]:
        """Return q and q̇, (*batch, n) each."""
        position = as_joint_array("q", q, self.robot.n, self.robot.joint_names)
        return position, np.broadcast_to(as_joint_array("qd", qd, self.robot.n), position.shape)

    def _repeat(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Return one state (q, q̇) for each rollout that the law inside or a rule has a row for, and others as given.

        The law inside is asked for its torques, as only they tell gains of joints from gains of rollouts.
        """
        rows = max(rule.count_rows() for rule in self.rules)
        if q.shape[:-1] == (1,) and any(np.size(getattr(self, name)) > 1 for name in self.gains):
            rows = max(rows, len(self.inner.law(0.0, q, qd, self.inner.start(q, qd)).tau))
        if rows == 1 or q.shape[:-1] not in ((), (1,)):
            return q, qd
        return np.broadcast_to(q, (rows, self.robot.n)).copy(), np.broadcast_to(qd, (rows, self.robot.n)).copy()

    def _check_listens(self, q: Array, qd: Array, own: Array) -> None:
        """Check at the start (q, q̇) that the law inside, in its state ``own``, goes by the speed that it is given.

        Raises:
            InputError: it would go on at full speed when it is held.
        """
        z = own.reshape(-1, own.shape[-1])
        shape = (*own.shape[:-1], self.robot.n)
        q, qd = (np.broadcast_to(part, shape).reshape(len(z), self.robot.n) for part in (q, qd))
        at_rest, at_full = (self.inner.at_speed(np.full(len(z), w)) for w in (0.0, 1.0))

        def is_deaf(t: float) -> bool:
            held, free = (law.law(t, q, qd, z) for law in (at_rest, at_full))
            moves = at_full.full_speed(free.s)[1] != 0
            same = (held.sdot == free.sdot) & (held.tau == free.tau).all(-1)
            return bool((same & moves).any())

        def is_deaf_later() -> bool:
            try:
                return is_deaf(_LATER)
            except Exception:  # a law need not know what to do at a time that the run may never reach
                return False

        if is_deaf(0.0) and is_deaf_later():
            kind = type(unwrap(self)).__name__
            raise InputError(
                f"{kind}.law gives the same torques and ṡ held and at full speed, expected one that goes by its speed; "
                "take the task from self.point(s), in place of self.task, and let the plan wait for the arm only where "
                "not self.timed(s)",
                argument="law",
                value=self.inner,
            )

    def law(self, t: float, q: Array, qd: Array, z: Array) -> ControlOutput:
        if q.shape[:-1] != z.shape[:-1]:  # one arm, and rules with a row for each rollout
            q, qd = (np.broadcast_to(part, (*z.shape[:-1], self.robot.n)) for part in (q, qd))
        own, *states = self.split(z)
        moment = self._ask(t, q, qd, own, states[-1][..., 0])
        asked = [Speed(np.ones(q.shape[:-1]), np.zeros(q.shape[:-1]))]
        for rule, x in zip(self.rules, states, strict=True):
            asked.append(Speed(x[..., 0], rule.rate(moment, asked[-1], x)))
        out, taken = moment.out, asked[-1].rate
        tau = out.tau + taken[..., None] * moment.gradient
        zdot = [out.zdot[..., :1] + (taken * moment.response)[..., None], out.zdot[..., 1:]]
        for rule, x, before, after in zip(self.rules, states, asked[:-1], asked[1:], strict=True):
            zdot += [after.rate[..., None], rule.memory_rate(moment, before, tau, x)]
        drift = out.drift + taken * moment.law.speed_response(own[..., 0], moment.theta)
        sdot = out.sdot + taken * moment.response
        return out._replace(tau=tau, zdot=np.concatenate(zdot, axis=-1), sdot=sdot, drift=drift)

    def rate(self, out: ControlOutput) -> Array:
        own, *rates = self.split(out.zdot)
        return np.concatenate([self.inner.rate(out._replace(zdot=own)), *rates], axis=-1)

    def advance(self, z: Array, out: ControlOutput, period: float) -> Array:
        own, *states = self.split(z)
        own_rate, *rates = self.split(out.zdot)
        law = self.inner.at_speed(states[-1][..., 0])
        parts = [law.advance(own, out._replace(zdot=own_rate), period)]
        parts += [rule.advance(x, xdot, period) for rule, x, xdot in zip(self.rules, states, rates, strict=True)]
        return np.concatenate(parts, axis=-1)

    def split(self, z: Array) -> list[Array]:
        """Return the state of the law inside, (*batch, m), and those of the rules, (*batch, size)."""
        parts, end = [], z.shape[-1]
        for rule in reversed(self.rules):
            parts.append(z[..., end - rule.size : end])
            end -= rule.size
        return [z[..., :end], *reversed(parts)]

    def _ask(self, t: float, q: Array, qd: Array, own: Array, factor: Array) -> Moment:
        """Return what the law inside says at a ``factor`` of its speed (*batch,)."""
        law = self.inner.at_speed(factor)
        out = law.law(t, q, qd, own)
        velocity, theta = law.full_speed(out.s)
        change, response = law.speed_gradient(q, qd, out.s, velocity)
        return Moment(t, q, qd, law, out, theta, self.robot.momentum(q, change), response)

    def outcome(self, z: Array) -> dict[str, Array]:
        return self.inner.outcome(self.split(z)[0])

    # --- for the record -------------------------------------------------------------------------------------

    def __repr__(self) -> str:
        settings = ", ".join(f"{name}={value}" for name, value in self.settings().items())
        return f"{type(self).__name__}({self.wrapped!r}, {settings})"

    def describe(self) -> dict[str, Any]:
        """Return the description of the law inside, with the names of all wrappers and the settings of their rules."""
        inner = self.wrapped.describe()
        named = {"controller": f"{type(self).__name__}({inner['controller']})"} | self.settings()
        return inner | named | {"wrappers": self._describe_wrappers(), "law": self._describe_innermost()}

    def settings(self) -> dict[str, Any]:
        """Return the settings of this wrapper, those of its rule, for the configuration of a run."""
        return {} if self.rule is None else self.rule.describe()

    def arguments(self) -> dict[str, Any]:
        """Return the arguments that make this wrapper around its law again, by name."""
        return self.settings()

    def _describe_wrappers(self) -> list[dict[str, Any]]:
        """Return name and arguments of each wrapper, the outermost first, and of a speed input that was changed."""
        chain = wrappers_of(self)
        said = [{"wrapper": type(one).__name__} | one.arguments() for one in chain]
        added = [rule for rule in self.rules if all(rule is not one.rule for one in chain)]
        changed = [rule for rule in added if rule.describe() != OverrideRule().describe()]
        return said + [{"wrapper": type(rule).__name__} | rule.describe() for rule in changed]

    def _describe_innermost(self) -> dict[str, Any]:
        """Return the description of the law inside all wrappers, without the arm and the task."""
        law = wrappers_of(self)[-1].wrapped.describe()
        return {name: value for name, value in law.items() if name not in ("robot", "task")}


def wrappers_of(law: Controller) -> list[LawWrapper]:
    """Return the wrappers around a law, the outermost first."""
    found: list[LawWrapper] = []
    while isinstance(law, LawWrapper):
        found.append(law)
        law = law.wrapped
    return found


def unwrap(law: Controller) -> Controller:
    """Return the innermost law of wrappers, or the law itself."""
    law = law.inner if isinstance(law, LawWrapper) else law
    return law.base if isinstance(law, LearningLaw) else law
