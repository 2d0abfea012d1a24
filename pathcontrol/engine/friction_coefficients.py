"""Friction laws as coefficients of the engine."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.engine.structs import MOST_STRIBECK, FrictionRows, Memory
from pathcontrol.errors import EngineError
from pathcontrol.robot.friction import Coulomb, FrictionLaw, FrictionOfGroups, FrictionSum, Stribeck, Viscous
from pathcontrol.robot.scaled_friction import ScaledFriction


class Coefficients(NamedTuple):
    """Coefficients of f = b q̇ + F(q̇), F± = level± + Σ fall exp(−(q̇/velocity)²); each array is (n,) or (N, n).

    Attributes:
        viscous: b [N m s/rad].
        forward: level for q̇ > 0 [N m].
        backward: level for q̇ < 0 [N m], ≥ 0.
        falling: pairs of fall [N m] and velocity [rad/s].
    """

    viscous: Array
    forward: Array
    backward: Array
    falling: tuple[tuple[Array, Array], ...] = ()

    def rows(self, n: int, memory: Memory) -> FrictionRows:
        """Return the coefficients for the engine."""
        rows = FrictionRows(stribeck=len(self.falling))
        for name in ("viscous", "forward", "backward"):
            setattr(rows, name, memory.rows(getattr(self, name), n))
        for k, (fall, velocity) in enumerate(self.falling):
            rows.fall[k], rows.velocity[k] = memory.rows(fall, n), memory.rows(velocity, n)
        return rows


def coefficients_of(law: FrictionLaw) -> Coefficients:
    """Return the coefficients of a law of the library, or of a sum of them.

    Raises:
        EngineError: it is a law of the user's own, or has too many Stribeck terms.
    """
    zero = np.zeros(law.n)
    if type(law) is Viscous:
        return Coefficients(law.viscous, zero, zero)
    if type(law) is Coulomb:
        return Coefficients(zero, *law.levels(zero))
    if type(law) is Stribeck:
        return Coefficients(zero, law.coulomb, law.coulomb, ((law.static - law.coulomb, law.velocity),))
    if type(law) is FrictionSum:
        return _add([coefficients_of(term) for term in law.terms])
    if type(law) is FrictionOfGroups:
        return _gather_groups(law)
    if type(law) is ScaledFriction:
        return _scale(coefficients_of(law.law), law.factor)
    raise EngineError(f"the friction law {type(law).__name__} is not one of the library", value=type(law).__name__)


def _add(terms: list[Coefficients]) -> Coefficients:
    """Add the coefficients of several laws."""
    falling = tuple(pair for term in terms for pair in term.falling)
    if len(falling) > MOST_STRIBECK:
        raise EngineError(
            f"the friction has {len(falling)} Stribeck terms, the engine takes {MOST_STRIBECK} at most",
            value=len(falling),
            limit=MOST_STRIBECK,
        )
    return Coefficients(
        sum((t.viscous for t in terms[1:]), terms[0].viscous),
        sum((t.forward for t in terms[1:]), terms[0].forward),
        sum((t.backward for t in terms[1:]), terms[0].backward),
        falling,
    )


def _scale(law: Coefficients, factor: Array) -> Coefficients:
    """Multiply the coefficients of a law."""
    falling = tuple((factor * fall, velocity) for fall, velocity in law.falling)
    return Coefficients(factor * law.viscous, factor * law.forward, factor * law.backward, falling)


def _gather_groups(law: FrictionOfGroups) -> Coefficients:
    """Return the coefficients (N, n) of laws of different kinds; a law without a Stribeck term falls by 0."""
    parts = [(coefficients_of(part), rows) for part, rows in law.parts]
    shape, terms = (law.rows, law.n), max(len(part.falling) for part, _ in parts)
    falling = tuple((np.zeros(shape), np.ones(shape)) for _ in range(terms))
    whole = Coefficients(np.zeros(shape), np.zeros(shape), np.zeros(shape), falling)
    for part, rows in parts:
        for name in ("viscous", "forward", "backward"):
            getattr(whole, name)[rows] = getattr(part, name)
        for (fall, velocity), own in zip(whole.falling, part.falling, strict=False):
            fall[rows], velocity[rows] = own
    return whole
