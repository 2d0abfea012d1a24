"""Friction of the joints from a run or a log: least squares on what the motors' torque did not move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from pathcontrol._arrays import Array, as_scalar
from pathcontrol._expect import expect_choice
from pathcontrol._json import to_json
from pathcontrol.analysis.disturbance_estimate import momentum_observer, motion_of
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Stribeck, Viscous
from pathcontrol.robot.model import RobotModel
from pathcontrol.simulation.run import Run

FrictionForm = Literal["viscous", "coulomb", "stribeck"]

_PARTS = 4  # of a window, in each of which the joint must move the same way
_FEWEST = 8  # windows in each direction
_SPREAD = 0.15  # of the speed, relative to its mean, below which slope and level cannot be told apart
_NONE = np.empty(0)
_SPEEDS = 60  # Stribeck velocities tried before the best is refined
#: the coefficients of each form, in the order of the columns of its regression
_COEFFICIENTS: dict[str, tuple[str, ...]] = {
    "viscous": ("viscous",),
    "coulomb": ("viscous", "coulomb_forward", "coulomb_backward"),
    "stribeck": ("viscous", "coulomb", "fall", "velocity"),
}


class Windows(NamedTuple):
    """The stretches of time in which a joint moves one way, as weighted means over each.

    Attributes:
        torque: friction torque [N m], (k,): what the motor gave and the motion of the arm does not explain.
        speed: velocities [rad/s] in the parts of each window, (k, parts), all of one sign.
        share: weights of the parts in the means, (parts,).
    """

    torque: Array
    speed: Array
    share: Array


@dataclass(frozen=True, eq=False)
class FrictionEstimate:
    """Friction coefficients with their standard errors, and what they are made of.

    Attributes:
        form: which coefficients there are.
        joints: names of the joints.
        coefficients: by their names, (n,) each: ``viscous`` [N m s/rad], ``coulomb_forward`` and ``coulomb_backward``
            [N m], or ``coulomb``, ``fall`` (static − Coulomb) [N m] and ``velocity`` [rad/s]; NaN where the run does
            not tell.
        errors: their standard errors, in the same units, (n,) each.
        residual: root mean square of what is left of the torque of a window [N m], (n,).
        remarks: why a joint's friction is not known, by its name; no entry for joints that were excited.
        windows: the data of each joint.
    """

    form: FrictionForm
    joints: tuple[str, ...]
    coefficients: dict[str, Array]
    errors: dict[str, Array]
    residual: Array
    remarks: dict[str, str]
    windows: tuple[Windows, ...]

    @property
    def law(self) -> FrictionLaw:
        """The friction law with these coefficients.

        Raises:
            InputError: the friction of a joint is not known.
        """
        if self.remarks:
            raise InputError("; ".join(self.remarks.values()), joint=next(iter(self.remarks)))
        known = self.coefficients
        if self.form == "viscous":
            return Viscous(known["viscous"])
        if self.form == "coulomb":
            return Viscous(known["viscous"]) + Coulomb(known["coulomb_forward"], known["coulomb_backward"])
        static = known["coulomb"] + known["fall"]
        return Viscous(known["viscous"]) + Stribeck(known["coulomb"], static, known["velocity"])

    def torque(self, joint: int, speed: Array) -> Array:
        """Return the friction torque [N m] of a joint by its number, at speeds [rad/s] of any shape."""
        values = np.array([self.coefficients[name][joint] for name in _COEFFICIENTS[self.form]])
        return _MODELS[self.form](np.asarray(speed, dtype=np.float64)[..., None], values[3:]) @ values[:3]

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers by joint, None where they are not known."""

        def of_joint(i: int) -> dict[str, Any]:
            values = {name: to_json(value[i]) for name, value in self.coefficients.items()}
            errors = {name: to_json(value[i]) for name, value in self.errors.items()}
            more = {"residual_rms": to_json(self.residual[i]), "windows": len(self.windows[i].torque)}
            return values | {"standard_errors": errors} | more | {"excited": self.joints[i] not in self.remarks}

        joints = {name: of_joint(i) for i, name in enumerate(self.joints)}
        return {"form": self.form, "joints": joints, "remarks": list(self.remarks.values())}


def identify_friction(
    run: Run,
    robot: RobotModel | None = None,
    *,
    form: FrictionForm = "coulomb",
    window: float = 0.05,
    min_speed: float = 0.02,
    measured: bool = True,
) -> FrictionEstimate:
    """Estimate the friction of all joints from a run, or a log, in which they move to and fro at several speeds.

    With the momentum p = M(q)q̇ and any φ that is 0 at both ends of a window of time, friction f obeys

        ∫φ f dt = ∫φ (τ + C(q,q̇)ᵀq̇ − g(q)) dt + ∫φ̇ p dt,

    so no acceleration is needed (modulating functions: M. Shinbrot, Trans. ASME 79, 1957); φ = (1 − x²)² falls to 0
    smoothly, which averages the noise of encoders and the chatter of a motor. Of each joint count the windows in which
    it moves one way all the time, faster than ``min_speed``. To their mean friction torques the coefficients are fitted
    by linear least squares, none below 0; the Stribeck velocity by a search around that. Standard errors are those of
    independent residuals.

    What else the model of the arm gets wrong, masses above all, is taken for friction as far as it looks like it.

    Args:
        run: a run of any law, or a log with q, q̇ and τ; all rollouts count.
        robot: the arm's model, whose friction is ignored; by default the one that the law computed with.
        form: ``"viscous"``, viscous and ``"coulomb"`` by direction, or viscous and ``"stribeck"``.
        window: length of the windows [s].
        min_speed: slowest speed that counts [rad/s].
        measured: take positions and velocities as the loop measured them; False for the true ones.

    Raises:
        InputError: the run does not know its robot, is shorter than a window, or a setting is not greater than 0.
        UnknownNameError: the run has no torques, or there is no such ``form``.
    """
    expect_choice("form", form, get_args(FrictionForm))
    slowest = as_scalar("min_speed", min_speed, positive=True)
    disturbance = momentum_observer(run, robot, cutoff_hz=np.inf, friction="none", measured=measured)
    time, _, qd = motion_of(run, measured)
    count = round(as_scalar("window", window, positive=True) / float(np.median(np.diff(time))))
    if not _PARTS <= count < len(time):
        raise InputError(
            f"window = {window:g} s is {count} samples of a run with {len(time)}, expected {_PARTS} or more, and fewer "
            "than it has",
            argument="window",
            value=window,
        )
    torque, joints = -disturbance, range(qd.shape[-1])
    windows = tuple(_select_windows(time, torque[..., i], qd[..., i], count, slowest) for i in joints)
    fits = [_fit_joint(form, data) for data in windows]
    return _collect(form, run.joints, windows, fits)


def _collect(form: FrictionForm, joints: list[str], windows: tuple[Windows, ...], fits: list[_Fit]) -> FrictionEstimate:
    """Return the fits of all joints as one estimate."""
    remarks = {name: f"{name} {fit.remark}" for name, fit in zip(joints, fits, strict=True) if fit.remark}
    names = _COEFFICIENTS[form]
    values = dict(zip(names, np.transpose([fit.values for fit in fits]), strict=True))
    errors = dict(zip(names, np.transpose([fit.errors for fit in fits]), strict=True))
    residual = np.array([fit.residual for fit in fits])
    return FrictionEstimate(form, tuple(joints), values, errors, residual, remarks, windows)


def _select_windows(time: Array, torque: Array, qd: Array, count: int, slowest: float) -> Windows:
    """Return the windows of ``count`` periods of all rollouts in which a joint moves one way.

    ``torque`` (rollout, time) is the mean friction torque over the period before each sample, q̇ (rollout, time).
    """
    whole = (len(time) - 1) // count * count
    weight = np.diff(time)[:whole].reshape(-1, count) * _bump(count)
    mean = (torque[:, 1 : whole + 1].reshape(len(torque), -1, count) * weight).sum(-1) / weight.sum(-1)
    between = 0.5 * (qd[:, 1 : whole + 1] + qd[:, :whole]).reshape(len(qd), -1, count)
    begin = np.arange(_PARTS) * count // _PARTS
    share = np.add.reduceat(weight, begin, axis=-1)
    parts = np.add.reduceat(between * weight, begin, axis=-1) / share
    one_way = (np.sign(parts) == np.sign(parts[..., :1])).all(-1) & (np.abs(parts).min(-1) >= slowest)
    used = one_way & np.isfinite(mean)
    return Windows(mean[used], parts[used], share.mean(0) / share.mean(0).sum())


def _bump(count: int) -> Array:
    """Return the weights (1 − x²)² of the periods of a window, (count,), 0 at its ends with their slope."""
    x = (2 * np.arange(count) + 1) / count - 1
    return (1 - x**2) ** 2


# --- one joint -----------------------------------------------------------------------------------------------------


class _Fit(NamedTuple):
    """The coefficients of one joint, their standard errors, the root mean square left, and why they are not known."""

    values: Array
    errors: Array
    residual: float
    remark: str


def _fit_joint(form: FrictionForm, data: Windows) -> _Fit:
    """Fit the coefficients of one joint."""
    size = len(_COEFFICIENTS[form])
    if remark := _missing_excitation(form, data):
        return _Fit(np.full(size, np.nan), np.full(size, np.nan), np.nan, remark)
    if form == "stribeck":
        return _fit_stribeck(data)
    return _regress(_columns(form, data), data.torque)


def _missing_excitation(form: FrictionForm, data: Windows) -> str:
    """Return what a joint did not do that the fit needs, or an empty text."""
    speed = data.speed.mean(-1)
    for sign, way in ((1, "forward"), (-1, "backward")):
        found = int((sign * speed > 0).sum())
        if form != "viscous" and found < _FEWEST:
            return f"moved {way} in {found} windows, expected {_FEWEST} or more: let it move to and fro, and faster"
    if len(speed) < _FEWEST:
        return f"moved one way in {len(speed)} windows, expected {_FEWEST} or more: let it move, and faster"
    if form != "viscous" and np.abs(speed).std() < _SPREAD * np.abs(speed).mean():
        mean = np.abs(speed).mean()
        return f"always moved at about {mean:.2g} rad/s, where level and slope look alike: vary its speed"
    return ""


def _regress(A: Array, y: Array, free: Array | None = None) -> _Fit:
    """Fit coefficients x ≥ 0 of A x ≈ y; ``free`` are further columns of the model's derivative, for the errors."""
    from scipy.optimize import lsq_linear  # takes a tenth of a second to load

    x = lsq_linear(A, y, bounds=(0.0, np.inf)).x
    left = y - A @ x
    jacobian = A if free is None else np.column_stack([A, free])
    spare = max(1, len(y) - jacobian.shape[1])
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * (left @ left) / spare
    return _Fit(x, np.sqrt(np.maximum(covariance.diagonal(), 0.0)), float(np.sqrt(np.mean(left**2))), "")


def _fit_stribeck(data: Windows) -> _Fit:
    """Fit viscous friction and a Stribeck curve; for each Stribeck velocity the rest is linear."""
    from scipy.optimize import minimize_scalar

    low, high = np.log(np.quantile(np.abs(data.speed), [0.0, 1.0]))

    def left(log_velocity: float) -> float:
        return _regress(_columns("stribeck", data, np.exp([log_velocity])), data.torque).residual

    tried = np.linspace(low - 1.0, high, _SPEEDS)
    best = int(np.argmin([left(one) for one in tried]))
    ends = tried[max(best - 1, 0)], tried[min(best + 1, _SPEEDS - 1)]
    velocity = np.exp([minimize_scalar(left, bounds=ends, method="bounded", options={"xatol": 1e-6}).x])
    A = _columns("stribeck", data, velocity)
    step = 1e-6 * velocity
    fit = _regress(A, data.torque)
    slope = (_columns("stribeck", data, velocity + step) - A) @ fit.values / step
    return _Fit(np.append(fit.values, velocity), _regress(A, data.torque, slope).errors, fit.residual, "")


def _columns(form: FrictionForm, data: Windows, nonlinear: Array = _NONE) -> Array:
    """Return the regressors of windows, (k, m): weighted means over their parts."""
    return np.einsum("kpm,p->km", _MODELS[form](data.speed[..., None], nonlinear), data.share)


def _viscous(v: Array, _: Array) -> Array:
    return v


def _coulomb(v: Array, _: Array) -> Array:
    return np.concatenate([v, (v > 0) * 1.0, (v < 0) * -1.0], axis=-1)


def _stribeck(v: Array, velocity: Array) -> Array:
    return np.concatenate([v, np.sign(v), np.sign(v) * np.exp(-((v / velocity) ** 2))], axis=-1)


#: the friction torque for a unit of each linear coefficient at speeds (…, 1), (…, m)
_MODELS: dict[str, Callable[[Array, Array], Array]] = {"viscous": _viscous, "coulomb": _coulomb, "stribeck": _stribeck}
