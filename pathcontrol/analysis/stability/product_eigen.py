"""Eigenvalues of a product of many matrices whose sizes are far apart, each to its own relative precision.

The eigenvalues of a lap may be as small as 1e-60 beside 1, and in the product itself they would be rounding. Orthogonal
iteration finds the nested invariant subspaces instead: A_k Q_k = Q_{k+1} R_k with R_k upper triangular, lap after lap
until they come back to themselves. In that basis the product is block triangular, with a block for eigenvalues of the
same size, and its rows are kept apart from their sizes (Dieci and Van Vleck, Applied Numerical Mathematics 17, 1995).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dgeqrf, dorgqr

from pathcontrol._arrays import Array

_SWEEPS, _FEW_SWEEPS = 40, 8
_TURNING = 0.1  # turn of a subspace in a sweep that goes on turning, as of a complex pair
_ZERO = 1e-9  # of the largest singular value
_ROUNDING = 1e-13  # of the largest size of one factor
_SETTLED = 1e-11  # turn of a subspace in the last sweep below which it is invariant
_FEW = 8  # products up to which each is orthogonalised on its own
_APART = 1e4  # how far apart sizes may come in what is solved, or multiplied, as one matrix


class ProductEigen(NamedTuple):
    """Logarithms of the eigenvalues, complex (D,), largest first, and unit eigenvectors, columns (D, D)."""

    logarithms: Array
    vectors: Array


def find_eigen(factors: Sequence[Array] | Array) -> ProductEigen:
    """Return the eigenvalues of A_K … A_2 A_1 for real ``factors`` A_1, A_2, …, (K, D, D)."""
    return find_eigen_of_many(np.asarray(factors)[None])[0]


def find_eigen_of_many(factors: Array, leading: bool = False) -> list[ProductEigen]:
    """Return the eigenvalues of many products at once, of ``factors`` (N, K, D, D).

    With ``leading`` only the largest ones are sought: fewer sweeps, and eigenvalues below 1e-9 of the largest may come
    out as rounding beside the others.
    """
    parts = _multiply(factors, _ZERO if leading else 0.0)
    # a basis in general position: one with an invariant subspace in it would never find what is outside
    size = factors.shape[-1]
    Q = np.tile(np.linalg.qr(np.random.default_rng(0).standard_normal((size, size)))[0], (len(factors), 1, 1))
    least = np.log(_ZERO) if leading else len(parts) * np.log(_ROUNDING)
    for count in range(_FEW_SWEEPS if leading else _SWEEPS):
        begin, (Q, sizes) = Q, _turn_round(parts, Q)
        turn = begin.swapaxes(-1, -2) @ Q
        if count and all(_is_done(*one, least, count) for one in zip(turn, sizes, strict=True)):
            break
    return [_solve(*one) for one in zip(begin, turn, *_multiply_triangles(parts, begin), strict=True)]


def _multiply(factors: Array, zero: float) -> Array:
    """Return products of some factors each, (parts, N, D, D), as many as leave the smallest sizes beside the largest.

    Singular values up to the share ``zero`` of the largest do not count.
    """
    singular = np.linalg.svd(factors, compute_uv=False)
    largest = singular[..., 0]
    smallest = np.where(singular >= zero * largest[..., None], singular, np.inf).min(-1)
    with np.errstate(divide="ignore"):
        spread = np.log(largest / smallest).mean(-1).max()
    count = factors.shape[1]
    size = int(np.clip(np.log(_APART) / max(spread, 1e-3), 1, count))
    parts = []
    for group in np.array_split(factors, -(-count // size), axis=1):
        product = group[:, 0]
        for i in range(1, group.shape[1]):
            product = group[:, i] @ product
        parts.append(product)
    return np.array(parts)


def _turn_round(parts: Array, Q: Array) -> tuple[Array, Array]:
    """Return the orthogonal matrices Q (N, D, D) after all parts, and logarithms of sizes of their rows, (N, D)."""
    diagonals = np.empty((len(parts), *Q.shape[:2]))
    for diagonal, part in zip(diagonals, parts, strict=True):
        Q, R = _orthogonalise(part @ Q)
        diagonal[:] = R.diagonal(axis1=-2, axis2=-1)
        Q *= np.where(diagonal < 0, -1.0, 1.0)[:, None]
    return Q, np.log(np.maximum(np.abs(diagonals), np.finfo(float).tiny)).sum(0)


def _orthogonalise(A: Array) -> tuple[Array, Array]:
    """Return Q and R of A = QR, (N, D, D) each; below its diagonal R has what LAPACK leaves there."""
    if len(A) > _FEW:
        Q, R = np.linalg.qr(A)
        return Q, R
    Q, R = np.empty_like(A), np.empty_like(A)
    for i, one in enumerate(A):  # NumPy calls the same routines, and takes most of its time to get there
        reflectors, tau, _, _ = dgeqrf(one)
        R[i] = reflectors
        Q[i] = dorgqr(reflectors, tau, overwrite_a=True)[0]
    return Q, R


def _multiply_triangles(parts: Array, Q: Array) -> tuple[Array, Array]:
    """Return the product of the triangular R of all parts, as logarithms of sizes of rows, (N, D), and rows U."""
    sizes, U = np.zeros(Q.shape[:2]), np.tile(np.eye(Q.shape[-1]), (len(Q), 1, 1))
    upper = np.triu(np.ones(Q.shape[1:]))
    for part in parts:
        Q, R = _orthogonalise(part @ Q)
        diagonal = R.diagonal(axis1=-2, axis2=-1)
        sign = np.where(diagonal < 0, -1.0, 1.0)
        Q, R = Q * sign[:, None], R * sign[..., None]
        # of the size of row j in that of row i
        shares = upper * np.exp(np.minimum(sizes[:, None] - sizes[..., None], 700.0))
        diagonal = np.maximum(np.abs(diagonal), np.finfo(float).tiny)
        sizes, U = sizes + np.log(diagonal), (R * shares) @ U / diagonal[..., None]
    return sizes, U


def _solve(begin: Array, turn: Array, sizes: Array, U: Array) -> ProductEigen:
    """Return the eigenvalues of one product from its last sweep."""
    found = [_solve_block(turn, sizes, U, rows) for rows in _find_blocks(turn)]
    logarithms = np.concatenate([one for one, _ in found])
    vectors = begin @ np.concatenate([one for _, one in found], axis=1)
    vectors = vectors / np.linalg.norm(vectors, axis=0)
    order = np.argsort(-logarithms.real, kind="stable")
    return ProductEigen(logarithms[order], vectors[:, order])


def _find_blocks(turn: Array) -> list[slice]:
    """Return the rows of blocks, between subspaces that the last sweep has not turned.

    Directions of eigenvalues of the same size go on turning, or settle slowly, and stay in one block.
    """
    settled = np.flatnonzero(_measure_turns(turn) < _SETTLED) + 1
    return [slice(begin, end) for begin, end in pairwise([0, *settled.tolist(), len(turn)])]


def _measure_turns(turn: Array) -> Array:
    """Return how far the last sweep has turned the subspaces of the first 1, 2, … directions, (D − 1,)."""
    return np.array([np.abs(turn[p:, :p]).max() for p in range(1, len(turn))])


def _is_done(turn: Array, sizes: Array, least: float, count: int) -> bool:
    """Return whether more sweeps change nothing that counts: rows less than exp(``least``) of the largest do not.

    Blocks between invariant subspaces, whose sizes are not far apart, have their eigenvalues however they lie in them;
    after some sweeps it is enough that what is not settled still turns round as fast.
    """
    turns = _measure_turns(turn)
    counted = sizes >= sizes.max() + least
    apart = [np.ptp(sizes[rows][counted[rows]]) for rows in _find_blocks(turn) if counted[rows].any()]
    turning = (turns < _SETTLED) | (turns > _TURNING)
    return bool(max(apart) < np.log(_APART) or (count >= _FEW_SWEEPS and turning.all()))


def _solve_block(turn: Array, sizes: Array, U: Array, rows: slice) -> tuple[Array, Array]:
    """Return logarithms of the eigenvalues of a block, and eigenvectors in the basis, (D, block)."""
    base = sizes[rows].max()
    block = turn[rows, rows] @ (np.exp(sizes[rows] - base)[:, None] * U[rows, rows])
    values, inside = np.linalg.eig(block)
    with np.errstate(divide="ignore"):
        logarithms = base + np.log(values.astype(complex))  # −∞ for 0
    vectors = np.zeros((len(sizes), len(values)), dtype=complex)
    vectors[rows] = inside
    before = slice(0, rows.start)
    for i, logarithm in enumerate(logarithms if rows.start else []):
        # rows before: U x − μ S⁻¹ Wᵀ x = −U y
        left = U[before, before] - np.exp(logarithm - sizes[before])[:, None] * turn[before, before].T
        vectors[before, i] = np.linalg.solve(left, -U[before, rows] @ inside[:, i])
    return logarithms, vectors
