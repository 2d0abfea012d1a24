"""Correction of approximate postures by Newton's method, many at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.cartesian.ik.constraint import Target, ToolConstraint
from pathcontrol.cartesian.ik.redundancy import PostureCost

KEPT = 0.5  # of the tolerance, by which the tool may be off at the postures themselves
_STEPS = 12
_ARRIVED = 1e-9  # rad; the next step would be its square
_LONGEST = 0.3  # rad, longest step of a joint
_DAMPING = 1e-5  # singular values below this count as zero
_PROBE = 1e-6  # rad, step of the difference quotient for second derivatives
_FLAT = 1e-3  # curvatures of H below this do not make a step longer


class Corrected(NamedTuple):
    """Corrected postures (N, n) with convergence, conditioning and branch of each, (N,).

    Attributes:
        q: the postures [rad].
        converged: whether Newton's method converged, to half the tolerance at least.
        conditioning: smallest singular value of ∂f/∂q, of those that are not zero everywhere.
        branch: on which side of singularities they are.
    """

    q: Array
    converged: Array
    conditioning: Array
    branch: Branch

    def rows(self, chosen: Array) -> Corrected:
        """Return the ``chosen`` postures."""
        return Corrected(self.q[chosen], self.converged[chosen], self.conditioning[chosen], self.branch.rows(chosen))


class _Linear(NamedTuple):
    """The linearisation at postures: f (N, m), ∂f/∂q (N, m, n), its inverse (N, n, m) and null space (N, k, n)."""

    f: Array
    slope: Array
    inverse: Array
    free: Array
    conditioning: Array
    branch: Branch


def correct(constraint: ToolConstraint, cost: PostureCost, q: Array, s: Array) -> Corrected:
    """Correct q (N, n) by Newton's method to satisfy the constraint at s (N,) and minimise H."""
    bases = Branch(*(np.zeros((len(q), *shape)) for shape in constraint.bases))
    out = Corrected(q.copy(), np.zeros(len(q), dtype=bool), np.zeros(len(q)), bases)
    moving, target = np.arange(len(q)), constraint.target(s)
    for _ in range(_STEPS):
        linear = _linearise(constraint, out.q[moving], target)
        step = -(linear.inverse @ linear.f[..., None])[..., 0]
        if constraint.freedom:
            step += _null_step(constraint, cost.rows(moving), out.q[moving], target, linear, step)
        size = np.abs(step).max(-1)
        out.q[moving] += step * np.minimum(1.0, _LONGEST / np.maximum(size, _LONGEST))[:, None]
        out.conditioning[moving] = linear.conditioning
        bases.left[moving], bases.right[moving] = linear.branch
        arrived = size < _ARRIVED
        out.converged[moving[arrived]] = constraint.excess(linear.f[arrived]) < KEPT
        if arrived.all():
            break
        moving, target = moving[~arrived], target.rows(~arrived)
    return out


def _linearise(constraint: ToolConstraint, q: Array, target: Target) -> _Linear:
    """Return the linearisation of the constraint at postures."""
    f, slope = constraint.towards(q, target)
    u, values, v = np.linalg.svd(slope)
    rank = constraint.rank
    used, rows = values[:, :rank], v[:, :rank]
    inverse = (rows.swapaxes(1, 2) * (used / (used**2 + _DAMPING**2))[:, None]) @ u[:, :, :rank].swapaxes(1, 2)
    return _Linear(f, slope, inverse, v[:, rank:], used[:, -1], Branch(u[:, :, :rank], rows))


def branch_at(constraint: ToolConstraint, q: Array, s: Array) -> Branch:
    """Return the side of singularities on which postures q (N, n) at s (N,) are."""
    return _linearise(constraint, q, constraint.target(s)).branch


def _null_step(
    constraint: ToolConstraint, cost: PostureCost, q: Array, target: Target, linear: _Linear, step: Array
) -> Array:
    """Return the part of Newton's step that does not move the tool, (N, n).

    With the Lagrangian L = H + λᵀf and λ = −(∂f/∂q)⁺ᵀ∇H, Z∇L = 0 at the optimum, Z the rows ``linear.free``; ∇²L
    along them is a difference quotient of ∇L. Where it is not positive the step still goes downhill.
    """
    free = linear.free
    count, k, n = free.shape
    beside = q[:, None] + _PROBE * free
    gradients = cost.gradients(np.concatenate([q[:, None], beside], axis=1))
    gradient = gradients[:, 0]
    multipliers = -(linear.inverse.swapaxes(1, 2) @ gradient[..., None])
    there = target if k == 1 else target.rows(np.repeat(np.arange(count), k))
    slopes = constraint.slope(beside.reshape(-1, n), there)
    turned = (slopes.reshape(count, k, -1, n) - linear.slope[:, None]).swapaxes(-1, -2) @ multipliers[:, None]
    bend = (turned[..., 0] + gradients[:, 1:] - gradient[:, None]) / _PROBE
    hessian = bend @ free.swapaxes(1, 2)
    curvature, axes = np.linalg.eigh(0.5 * (hessian + hessian.swapaxes(1, 2)))
    downhill = -(free @ gradient[..., None] + bend @ step[..., None])
    inside = axes.swapaxes(1, 2) @ downhill / np.maximum(np.abs(curvature), _FLAT)[..., None]
    return (free.swapaxes(1, 2) @ axes @ inside)[..., 0]


class Branch(NamedTuple):
    """Bases of the ranges of ∂f/∂q and of its transpose at postures, paired by a singular value decomposition.

    Where ∂f/∂q is square, det U det V is the sign of its determinant, which changes where the arm passes a singularity,
    such as a straight elbow. Bases of rank r say the same where there are more joints or more rows than that.

    Attributes:
        left: U, (N, m, r).
        right: Vᵀ, (N, r, n).
    """

    left: Array
    right: Array

    def rows(self, chosen: Array) -> Branch:
        """Return the branch of the ``chosen`` postures."""
        return Branch(self.left[chosen], self.right[chosen])

    def differs(self, other: Branch) -> Array:
        """Return whether a singularity lies between these postures and others next to them, (N,)."""
        turned = np.linalg.det(self.left.swapaxes(1, 2) @ other.left)
        return np.asarray(turned * np.linalg.det(self.right @ other.right.swapaxes(1, 2)) < 0)
