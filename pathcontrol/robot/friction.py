"""Joint friction laws as small immutable values.

Every law is a viscous part and a dry part: at joint velocity q̇ the friction torque is

    f(q̇) = b q̇ + F(q̇),    F_i ∈ {F⁺_i} if q̇_i > 0,  {−F⁻_i} if q̇_i < 0,  [−F⁻_i, F⁺_i] if q̇_i = 0,

with the levels F⁺, F⁻ ≥ 0 [N m], which may themselves depend on q̇ (Stribeck). The set at zero velocity is stiction:
the joint holds as long as it can. Laws add up with ``+``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from pathcontrol._arrays import SMALLEST, Array, as_array, check_physical, freeze
from pathcontrol.arguments import Form, Unit
from pathcontrol.errors import InputError, UnknownNameError, about
from pathcontrol.registry import FRICTION_LAWS


def _coefficients(name: str, value: ArrayLike, argument: str) -> Array:
    """Check that coefficients are finite and not negative, one for each joint."""
    with about(argument=argument):
        array = check_physical(name, np.atleast_1d(as_array(name, value)))
        if (array < 0).any():
            wanted = "no negative value: friction takes energy out"
            raise InputError(f"{name} = {array.tolist()}, expected {wanted}", argument=argument, value=value)
    return freeze(array)


@dataclass(frozen=True, eq=False)
class FrictionLaw(ABC):
    """Friction torque of the joints as a function of their velocities."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        own = [name for name in ("torque", "smoothed") if name in cls.__dict__]
        if own and not {"levels", "viscous"} & cls.__dict__.keys():
            raise InputError(
                f"{cls.__name__} overrides {own[0]}(), which the simulated arm does not ask; override levels(qd), the "
                "dry friction (F⁺, F⁻) ≥ 0 in N m at a velocity, and viscous, the coefficients b: torque() follows "
                "from them"
            )

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of joints."""

    @property
    def viscous(self) -> Array:
        """Viscous coefficients b [N m s/rad], shape (n,)."""
        return np.zeros(self.n)

    def levels(self, qd: Array) -> tuple[Array, Array]:
        """Return the dry friction levels (F⁺, F⁻) ≥ 0 [N m] at joint velocities ``qd`` (*batch, n) [rad/s].

        The levels broadcast against ``qd``: a law whose levels are constant returns shape (n,).
        """
        return np.zeros(self.n), np.zeros(self.n)

    def torque(self, qd: Array) -> Array:
        """Return the friction torque f(q̇) [N m], (*batch, n); where q̇ = 0 the dry part is given as 0."""
        plus, minus = levels_of(self, qd)
        return viscous_of(self) * qd + np.where(qd > 0, plus, 0.0) - np.where(qd < 0, minus, 0.0)

    def smoothed(self, qd: Array, width: float) -> Array:
        """Return the friction torque [N m] with the step at zero replaced by tanh(q̇/width); ``width`` in rad/s."""
        plus, minus = levels_of(self, qd)
        blend = np.tanh(qd / width)
        return viscous_of(self) * qd + 0.5 * ((plus + minus) * blend + (plus - minus) * blend**2)

    def select(self, joints: Sequence[int]) -> Self:
        """Return the same law for some of the joints."""
        index = list(joints)
        return type(self)(*(_select_joints(getattr(self, f.name), index) for f in fields(self)))

    def __add__(self, other: FrictionLaw) -> FrictionSum:
        return FrictionSum((self, other))

    def __radd__(self, other: object) -> FrictionLaw:  # sum(...) begins with 0
        return self if isinstance(other, int) and other == 0 else NotImplemented

    def describe(self) -> dict[str, object]:
        """Return the name of the law and its coefficients, for the record of a run."""
        return {"law": type(self).__name__} | {f.name: np.asarray(getattr(self, f.name)).tolist() for f in fields(self)}


def _select_joints(value: ArrayLike, joints: list[int]) -> Any:
    """Return the values of some joints, (…, n); a single number holds for all joints."""
    array = np.asarray(value)
    return array[..., joints] if array.ndim else value


@dataclass(frozen=True, eq=False)
class Viscous(FrictionLaw):
    """Viscous friction f = b q̇ with ``coefficients`` b [N m s/rad], shape (n,)."""

    coefficients: Annotated[Array, Form.NUMBERS, Unit("N m s/rad")]

    def __post_init__(self) -> None:
        coefficients = _coefficients("viscous coefficients", self.coefficients, "coefficients")
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def n(self) -> int:
        return self.coefficients.shape[-1]

    @property
    def viscous(self) -> Array:
        return self.coefficients


@dataclass(frozen=True, eq=False)
class Coulomb(FrictionLaw):
    """Coulomb friction with stiction: level ``plus`` [N m] for q̇ > 0 and ``minus`` for q̇ < 0 (default: the same)."""

    plus: Annotated[Array, Form.NUMBERS, Unit("N m")]
    minus: Annotated[Array, Form.NUMBERS, Unit("N m")] | None = None

    def __post_init__(self) -> None:
        plus = _coefficients("Coulomb friction for positive velocity", self.plus, "plus")
        minus = plus
        if self.minus is not None:
            minus = _coefficients("Coulomb friction for negative velocity", self.minus, "minus")
        if plus.shape[-1] != minus.shape[-1]:
            raise InputError(
                f"Coulomb levels for {plus.shape[-1]} joints forward and {minus.shape[-1]} backward; give both for all",
                argument="minus",
                value=self.minus,
            )
        object.__setattr__(self, "plus", plus)
        object.__setattr__(self, "minus", minus)

    @property
    def n(self) -> int:
        return self.plus.shape[-1]

    def levels(self, qd: Array) -> tuple[Array, Array]:
        assert self.minus is not None
        return self.plus, self.minus


@dataclass(frozen=True, eq=False)
class Stribeck(FrictionLaw):
    """Dry friction that falls from ``static`` to ``coulomb`` [N m] as the joint starts to move.

    F(q̇) = F_c + (F_s − F_c) exp(−(q̇/v_s)²) with the Stribeck velocity ``velocity`` v_s [rad/s], all of shape (n,)
    (Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994).
    """

    coulomb: Annotated[Array, Form.NUMBERS, Unit("N m")]
    static: Annotated[Array, Form.NUMBERS, Unit("N m")]
    velocity: Annotated[Array, Form.NUMBERS, Unit("rad/s")]

    def __post_init__(self) -> None:
        for name in ("coulomb", "static", "velocity"):
            object.__setattr__(self, name, _coefficients(f"Stribeck {name}", getattr(self, name), name))
        sizes = {name: getattr(self, name).shape[-1] for name in ("coulomb", "static", "velocity")}
        if len(set(sizes.values())) != 1:
            raise InputError(
                f"Stribeck coefficients for different numbers of joints, {sizes}; expected one each per joint",
                value=sizes,
            )
        if (self.static < self.coulomb).any() or (self.velocity < SMALLEST).any():
            raise InputError(
                f"Stribeck friction with static {self.static.tolist()}, Coulomb {self.coulomb.tolist()} and velocity "
                f"{self.velocity.tolist()}; expected static ≥ Coulomb and velocity > 0 at each joint, of {SMALLEST:g} "
                "rad/s or more",
                argument="static",
                value=self.static,
                limit=self.coulomb,
            )

    @property
    def n(self) -> int:
        return self.coulomb.shape[-1]

    def levels(self, qd: Array) -> tuple[Array, Array]:
        level = self.coulomb + (self.static - self.coulomb) * np.exp(-((qd / self.velocity) ** 2))
        return level, level


@dataclass(frozen=True, eq=False)
class FrictionSum(FrictionLaw):
    """The sum of several laws, as ``Viscous(b) + Coulomb(plus, minus)``."""

    terms: tuple[FrictionLaw, ...]

    def __post_init__(self) -> None:
        sizes = sorted({term.n for term in self.terms})
        if len(sizes) != 1:
            raise InputError(
                f"friction laws for {sizes} joints cannot be added; give each law one value per joint", value=sizes
            )

    @property
    def n(self) -> int:
        return self.terms[0].n

    @property
    def viscous(self) -> Array:
        return sum((viscous_of(term) for term in self.terms), np.zeros(self.n))

    def levels(self, qd: Array) -> tuple[Array, Array]:
        plus, minus = zip(*(levels_of(term, qd) for term in self._dry_terms), strict=True)
        return sum(plus[1:], plus[0]), sum(minus[1:], minus[0])

    @cached_property
    def _dry_terms(self) -> tuple[FrictionLaw, ...]:
        """The terms that may have dry friction, or one that has none: others are not asked in every step."""
        return tuple(term for term in self.terms if type(term) is not Viscous) or self.terms[:1]

    def select(self, joints: Sequence[int]) -> Self:
        return type(self)(tuple(term.select(joints) for term in self.terms))

    def describe(self) -> dict[str, object]:
        return {"law": "FrictionSum", "terms": [term.describe() for term in self.terms]}


@dataclass(frozen=True, eq=False)
class FrictionOfGroups(FrictionLaw):
    """Several friction laws, each for some rows of a batch: ``parts`` are pairs of a law and its rows, (k,)."""

    parts: tuple[tuple[FrictionLaw, Array], ...]
    rows: int

    @property
    def n(self) -> int:
        return self.parts[0][0].n

    @property
    def viscous(self) -> Array:
        merged = np.empty((self.rows, self.n))
        for law, rows in self.parts:
            merged[rows] = viscous_of(law)
        return merged

    def levels(self, qd: Array) -> tuple[Array, Array]:
        qd = np.broadcast_to(qd, (self.rows, self.n))
        found = [levels_of(law, qd[rows]) for law, rows in self.parts]
        plus, minus = np.empty((2, self.rows, self.n))
        for (_, rows), (p, m) in zip(self.parts, found, strict=True):
            plus[rows], minus[rows] = p, m
        return plus, minus

    def describe(self) -> dict[str, object]:
        parts = [law.describe() | {"rollouts": len(rows)} for law, rows in self.parts]
        return {"law": "FrictionOfGroups", "parts": parts}


def friction_of_each(laws: Sequence[FrictionLaw]) -> FrictionLaw:
    """Combine the laws of many rollouts, each (n,), into one law for the batch; row i follows ``laws[i]``."""
    if all(law is laws[0] for law in laws):
        return laws[0]
    kinds: dict[Any, list[int]] = {}
    for i, law in enumerate(laws):
        kinds.setdefault(_kind(law), []).append(i)
    if len(kinds) == 1:
        return _stack(laws)
    parts = ((_stack([laws[i] for i in rows]), np.array(rows)) for rows in kinds.values())
    return FrictionOfGroups(tuple(parts), len(laws))


def _kind(law: FrictionLaw) -> Any:
    """Return a key that is equal for laws that differ in their coefficients only; a user's law has a key of its own."""
    if type(law) is FrictionSum:
        return tuple(_kind(term) for term in law.terms)
    return type(law) if type(law) in _LAWS.values() else id(law)


def _stack(laws: Sequence[FrictionLaw]) -> FrictionLaw:
    """Stack laws of one kind into one with coefficients (N, n)."""
    first = laws[0]
    if all(law is first for law in laws):
        return first
    if isinstance(first, FrictionSum):
        terms = zip(*(law.terms for law in laws if isinstance(law, FrictionSum)), strict=True)
        return FrictionSum(tuple(_stack(term) for term in terms))
    return type(first)(*(np.stack([getattr(law, f.name) for law in laws]) for f in fields(first)))


def select_rollout(law: FrictionLaw, row: int) -> FrictionLaw:
    """Return the law of one rollout, (n,), from one with a row of coefficients for each; any other as it is."""
    if isinstance(law, FrictionSum):
        return FrictionSum(tuple(select_rollout(term, row) for term in law.terms))
    if isinstance(law, FrictionOfGroups):
        [(part, at)] = [(part, np.flatnonzero(rows == row)) for part, rows in law.parts if row in rows]
        return select_rollout(part, int(at[0]))
    if type(law) not in _LAWS.values():
        return law
    values = (np.asarray(getattr(law, field.name)) for field in fields(law))
    return type(law)(*(value[row % len(value)] if value.ndim > 1 else value for value in values))


def viscous_of(law: FrictionLaw) -> Array:
    """Return the viscous coefficients [N m s/rad], (*batch, n); a law of one's own may give a number or a tuple."""
    array = np.asarray(law.viscous, dtype=np.float64)
    return array if array.ndim else np.full(law.n, array)


def levels_of(law: FrictionLaw, qd: Array) -> tuple[Array, Array]:
    """Return the dry levels (F⁺, F⁻) [N m] at ``qd`` as arrays; a law of one's own may give numbers or tuples."""
    plus, minus = law.levels(qd)
    return np.asarray(plus, dtype=np.float64), np.asarray(minus, dtype=np.float64)


def levels_vary(law: FrictionLaw) -> bool:
    """Return whether the levels change with velocity, as tested at a few velocities where the law is not known."""
    if isinstance(law, FrictionSum):
        return any(map(levels_vary, law.terms))
    if type(law) in (Viscous, Coulomb):
        return False
    rest = law.levels(np.zeros((1, law.n)))
    tried = [law.levels(np.full((1, law.n), qd)) for qd in (-3.0, -0.1, -1e-3, 1e-3, 0.1, 3.0)]
    return any(not np.array_equal(a, b) for pair in tried for a, b in zip(pair, rest, strict=True))


def check_consistent(law: FrictionLaw) -> None:
    """Check at a few velocities that the methods of a user's law agree with each other.

    The simulated arm asks ``levels`` and ``viscous``, continuous time asks ``smoothed``, and ``torque`` is their sum.

    Raises:
        InputError: levels are negative or no numbers, or ``torque`` or ``smoothed`` is overridden and differs.
    """
    terms = law.terms if isinstance(law, FrictionSum) else [part for part, _ in getattr(law, "parts", ())]
    for term in terms:
        check_consistent(term)
    if not terms and type(law) not in _LAWS.values():
        for speed in _TRIED:
            _check_levels(law, np.full(law.n, speed))
            _check_torque(law, np.full(law.n, speed))


def _check_levels(law: FrictionLaw, qd: Array) -> None:
    """Check that the levels are finite and not negative."""
    for name, level in zip(("F⁺", "F⁻"), law.levels(qd), strict=True):
        if not (np.asarray(level) >= 0).all() or not np.isfinite(level).all():
            raise InputError(
                f"{type(law).__name__}.levels gives {name} = {np.asarray(level).tolist()} N m at {qd[0]:g} rad/s, "
                "expected numbers that are not negative: the level is a strength, its direction is that of motion",
                value=np.asarray(level),
            )


def _check_torque(law: FrictionLaw, qd: Array) -> None:
    """Check that ``torque`` and, far beyond its width, ``smoothed`` follow from ``levels`` and ``viscous``."""
    expected = np.asarray(FrictionLaw.torque(law, qd), dtype=np.float64)
    for name, torque in (("torque", law.torque(qd)), ("smoothed", law.smoothed(qd, 1e-6 * float(np.abs(qd[0]))))):
        off = np.abs(torque - expected) > 1e-3 * np.abs(expected) + 1e-9
        if off.any():
            i = tuple(np.argwhere(off)[0])
            said = np.broadcast_to(torque, off.shape)[i]
            raise InputError(
                f"{type(law).__name__}.{name} gives {said:g} N m at {qd[0]:g} rad/s for joint {i[-1]}, but levels and "
                f"viscous, which the simulated arm asks, give {expected[i]:g} N m; leave {name}() out, which follows "
                "from them, or make them agree",
                value=said,
                limit=expected[i],
            )


def no_friction(n: int) -> FrictionLaw:
    """Return the friction law of ``n`` joints without any friction."""
    return Viscous(np.zeros(n))


_TRIED = (-2.0, -0.3, -0.02, 0.02, 0.3, 2.0)  # rad/s
_LAWS = {law.__name__: law for law in (Viscous, Coulomb, Stribeck)}


def rebuild_law(description: Mapping[str, Any]) -> FrictionLaw:
    """Return the law that :meth:`FrictionLaw.describe` described, of the library or a class of the user.

    Raises:
        UnknownNameError: there is no such law, or it describes itself in its own way.
    """
    values = dict(description)
    name = values.pop("law", None)
    if name == "FrictionSum":
        return FrictionSum(tuple(rebuild_law(term) for term in values["terms"]))
    own = {key: law for key, law in FRICTION_LAWS.defined().items() if law.describe is FrictionLaw.describe}
    if name in (known := _LAWS | own):
        return known[name](**values)
    raise UnknownNameError(
        f"friction law {name!r}, expected one of {', '.join(known)} or a FrictionSum of them; import the module that "
        "defines it first",
        value=name,
        choices=tuple(known),
    )
