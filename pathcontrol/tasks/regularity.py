"""The regularity of a path: it neither stands still nor turns back, and one by hand neither jumps nor has corners."""

from __future__ import annotations

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import TaskError
from pathcontrol.tasks.base import Task

_SAMPLES = 129
_GOLDEN = (5**0.5 - 1) / 2
_HALVINGS = 20  # of the stretch between two samples, to 1e-8 of the domain: nearer to a tip, computed q_d' is rounding
_OPPOSITE = -0.99  # cosine of an angle
_SHARPEST = 8  # stretches between samples that are searched for corners
_CLOSER = 6  # halvings of these, and as many again: a bend turns 64 times less then, a corner as much
_CORNER = 0.1  # rad, below which the turn at one place is no corner but may be the noise of a function
_BESIDE = 33  # stretches to each side of a corner in which a smooth path turns much less
_NOISE = 0.1  # of the corner's turn
_JUMP_HALVINGS = 12
_JUMP = 0.05  # of the longest chord between two samples; a smooth path has some 2^-12 left
_TINY = np.finfo(np.float64).tiny


def check_regular(task: Task) -> None:
    """Check that a path is regular, and if its q_d is by hand that it is continuous, without corners and noise.

    Raises:
        TaskError: it is not, and where.
    """
    if task.by_hand:
        _check_precision(task)
        check_jumps(task)  # beside a jump computed derivatives look like a cusp
    check_moves(task)
    if task.by_hand:
        check_corners(task)


def pick_irregular(task: Task) -> Array:
    """Return places inside the domain of a path that are no round numbers and no kinks of tables and splines."""
    lower, upper = task.sampled_interval
    return lower + (upper - lower) * (0.01 + 0.98 * np.modf(_GOLDEN * np.arange(1, _SAMPLES))[0])


def check_moves(task: Task) -> None:
    """Check that a path is regular on its domain: it neither stands still nor turns back.

    Raises:
        TaskError: it does, and where.
    """
    name, s = type(task).__name__, np.linspace(*task.sampled_interval, _SAMPLES)
    tangent = np.asarray(task.dq_d(s))
    length = np.linalg.norm(tangent, axis=-1)
    _check_regular(name, s, length)
    _check_cusps(task, name, s, tangent / np.maximum(length[:, None], _TINY))


def _check_regular(name: str, s: Array, length: Array) -> None:
    """Check that the path never stands still: q_d' vanishes nowhere."""
    if not length.min() > 1e-9 * length.max():
        raise TaskError(
            f"{name}.dq_d(s={s[int(np.argmin(length))]:g}) has length {length.min():.1e}, expected a path that moves "
            "with s everywhere: q_d' = 0 is a cusp or a standstill",
            s=float(s[int(np.argmin(length))]),
        )


def _check_cusps(task: Task, name: str, s: Array, directions: Array) -> None:
    """Check that the path turns back nowhere: its ``directions`` (k, n) at s do not reverse between samples."""
    turns = np.flatnonzero((directions[1:] * directions[:-1]).sum(-1) < 0)
    if not turns.size:
        return
    left, right, before = s[turns], s[turns + 1], directions[turns]
    for _ in range(_HALVINGS):
        middle = 0.5 * (left + right)
        ahead = (_directions(task, middle) * before).sum(-1) > 0
        left, right = np.where(ahead, middle, left), np.where(ahead, right, middle)
    beside = right - left  # at the tip itself a direction is rounding
    left, right = np.maximum(left - beside, s[0]), np.minimum(right + beside, s[-1])
    cosine = (_directions(task, left) * _directions(task, right)).sum(-1)
    # between the paths of a sequence the arm comes to rest, and may turn round
    rests = np.asarray(getattr(task, "starts", ()))
    cosine[((rests >= left[:, None]) & (rests <= right[:, None])).any(-1)] = 1.0
    if cosine.min() < _OPPOSITE:
        raise TaskError(
            f"{name} turns back at s = {left[int(np.argmin(cosine))]:g}, expected a path without cusps: no arm that "
            "moves can turn round at once; end the path there, or round the tip",
            s=float(left[int(np.argmin(cosine))]),
        )


def _check_precision(task: Task) -> None:
    """Check that q_d does not compute in single precision: over short stretches such a path turns at random."""
    s = pick_irregular(task)
    q = np.asarray(task.q_d(s), dtype=np.float64)
    with np.errstate(over="ignore"):
        single = (q == q.astype(np.float32)).all()
    if single and len(np.unique(q)) > len(s) // 2:
        raise TaskError(
            f"{type(task).__name__}.q_d(s={s[0]:g}) = {q[0].tolist()} and all others are numbers of single precision, "
            "expected double precision: derivatives and nearest points are rounding at seven digits; return "
            'np.float64 (with JAX: jax.config.update("jax_enable_x64", True), with PyTorch: torch.float64)',
            value=q[0].tolist(),
            s=float(s[0]),
        )


def check_corners(task: Task) -> None:
    """Check that the direction of a path jumps nowhere, by q_d itself: computed derivatives round a corner off.

    Raises:
        TaskError: it does, and where.
    """
    s = np.linspace(*task.sampled_interval, _SAMPLES)
    if task.period is not None:
        s = np.append(s, task.s0 + task.period + s[1:3] - s[0])  # over the seam
    left, right = s[:-2], s[2:]  # of two stretches each, so that no corner is at an end only
    sharpest = np.argsort(_turns(task, left, right))[-_SHARPEST:]
    left, right = _approach(task, left[sharpest], right[sharpest])
    before = _turns(task, left, right)
    left, right = _approach(task, left, right)
    turn = _turns(task, left, right)
    corner = (turn > _CORNER) & (turn > 0.5 * before)
    if corner.any():
        i = int(np.argmax(np.where(corner, turn, 0.0)))
        at = float(0.5 * (left[i] + right[i]))
        _check_smooth(task, left[i], right[i], turn[i])
        raise TaskError(
            f"{type(task).__name__}.q_d has a corner at s = {at:.6g}, where its direction turns by "
            f"{np.rad2deg(turn[i]):.3g}° at once, expected a path that is twice continuously differentiable; round it, "
            "as WaypointPath does, or end the path there and run the parts by simulate_sequence",
            s=at,
        )


def _check_smooth(task: Task, left: float, right: float, turn: float) -> None:
    """Check that a path turns less beside a stretch in which it has the largest ``turn`` [rad]."""
    beside = (right - left) * np.r_[-_BESIDE:-1, 2 : _BESIDE + 1]
    lower, upper = task.sampled_interval
    beside = beside[(left + beside >= lower) & (right + beside <= upper)]
    around = float(np.median(_turns(task, left + beside, right + beside)))
    if around > _NOISE * turn:
        raise TaskError(
            f"{type(task).__name__}.q_d is rough around s = {left:.6g}: over {right - left:.1e} of s its direction "
            f"turns by {np.rad2deg(around):.3g}° everywhere, expected a path that is twice continuously "
            "differentiable; compute it to full precision, or smooth samples of it by SplinePath.from_samples",
            s=float(left),
        )


def check_jumps(task: Task) -> None:
    """Check that a path is continuous, by q_d itself: between any two samples the chord shrinks with the stretch.

    Raises:
        TaskError: it jumps, and where.
    """
    left, right = (s := np.linspace(*task.sampled_interval, _SAMPLES))[:-1], s[1:]
    q_left, q_right = (q := np.asarray(task.q_d(s)))[:-1], q[1:]
    whole = np.linalg.norm(q_right - q_left, axis=-1)
    for _ in range(_JUMP_HALVINGS):
        middle = 0.5 * (left + right)
        q = np.asarray(task.q_d(middle))
        before, after = np.linalg.norm(q - q_left, axis=-1), np.linalg.norm(q_right - q, axis=-1)
        first, whole = before > after, np.fmax(whole, np.fmax(before, after))  # no numbers are no jump
        left, right = np.where(first, left, middle), np.where(first, middle, right)
        q_left, q_right = np.where(first[:, None], q_left, q), np.where(first[:, None], q, q_right)
    jump = np.linalg.norm(q_right - q_left, axis=-1)
    jump[~(jump > _JUMP * whole)] = 0.0
    if jump.any():
        i = int(jump.argmax())
        raise TaskError(
            f"{type(task).__name__}.q_d jumps by {jump[i]:.3g} at s = {right[i]:.6g}, expected a continuous path; "
            "np.unwrap mends angles that jump by 2π, and simulate_sequence(…, gaps=True) runs parts that do not meet",
            s=float(right[i]),
        )


def _approach(task: Task, left: Array, right: Array) -> tuple[Array, Array]:
    """Return the parts of stretches, 2^_CLOSER times shorter, in which the path turns the most."""
    for _ in range(_CLOSER):
        quarter = 0.25 * (right - left)
        starts = np.stack([left + i * quarter for i in range(3)])
        best = _turns(task, starts, starts + 2 * quarter).argmax(0)
        left = starts[best, np.arange(len(left))]
        right = left + 2 * quarter
    return left, right


def _turns(task: Task, left: Array, right: Array) -> Array:
    """Return the angles [rad] between the chords of the first and of the last quarter of stretches."""
    quarter = 0.25 * (right - left)
    ends = np.stack([left, left + quarter, right - quarter, right])
    q = np.asarray(task.q_d(ends.ravel())).reshape(*ends.shape, -1)
    a, b = (
        chord / np.maximum(np.linalg.norm(chord, axis=-1, keepdims=True), _TINY) for chord in (q[1] - q[0], q[3] - q[2])
    )
    return np.asarray(2 * np.arctan2(np.linalg.norm(b - a, axis=-1), np.linalg.norm(b + a, axis=-1)))


def _directions(task: Task, s: Array) -> Array:
    """Return the unit tangents q_d'/‖q_d'‖, (*batch, n)."""
    tangent = np.asarray(task.dq_d(s))
    return tangent / np.maximum(np.linalg.norm(tangent, axis=-1, keepdims=True), _TINY)
