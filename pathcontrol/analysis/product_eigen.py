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

from pathcontrol._arrays import Array

_SWEEPS = 40
_SETTLED = 1e-8  # turn of a subspace in the last sweep below which it is invariant
_APART = 1e4  # how far apart sizes may come in factors that are multiplied before they are orthogonalised


class ProductEigen(NamedTuple):
    """Logarithms of the eigenvalues, complex (D,), largest first, and unit eigenvectors, columns (D, D)."""

    logarithms: Array
    vectors: Array


def find_eigen(factors: Sequence[Array] | Array) -> ProductEigen:
    """Return the eigenvalues of A_K … A_2 A_1 for real ``factors`` A_1, A_2, …, (K, D, D)."""
    parts = _multiply(np.asarray(factors))
    # a basis in general position: one with an invariant subspace in it would never find what is outside
    Q = np.linalg.qr(np.random.default_rng(0).standard_normal(parts.shape[1:]))[0]
    for _ in range(_SWEEPS):
        begin = Q
        Q, sizes, U = _sweep(parts, begin)
    turn = begin.T @ Q
    found = [_solve_block(turn, sizes, U, rows) for rows in _find_blocks(turn)]
    logarithms = np.concatenate([one for one, _ in found])
    vectors = begin @ np.concatenate([one for _, one in found], axis=1)
    vectors = vectors / np.linalg.norm(vectors, axis=0)
    order = np.argsort(-logarithms.real, kind="stable")
    return ProductEigen(logarithms[order], vectors[:, order])


def _multiply(factors: Array) -> Array:
    """Return products of some factors each, as many as leave the smallest sizes beside the largest."""
    spread = np.log(np.linalg.cond(factors)).mean()
    together = int(np.clip(np.log(_APART) / max(spread, 1e-3), 1, len(factors)))
    parts = []
    for group in np.array_split(factors, -(-len(factors) // together)):
        product = group[0]
        for one in group[1:]:
            product = one @ product
        parts.append(product)
    return np.array(parts)


def _sweep(parts: Array, Q: Array) -> tuple[Array, Array, Array]:
    """Return Q after all parts, and the triangular product as logarithms of sizes of its rows, (D,), and rows U."""
    sizes, U = np.zeros(len(Q)), np.eye(len(Q))
    for part in parts:
        Q, R = np.linalg.qr(part @ Q)
        sign = np.where(np.diagonal(R) < 0, -1.0, 1.0)
        Q, R = Q * sign, R * sign[:, None]
        shares = np.exp(np.minimum(sizes - sizes[:, None], 700.0))  # of the size of row j in that of row i
        diagonal = np.maximum(np.diagonal(R), np.finfo(float).tiny)
        sizes, U = sizes + np.log(diagonal), (R * np.triu(shares)) @ U / diagonal[:, None]
    return Q, sizes, U


def _find_blocks(turn: Array) -> list[slice]:
    """Return the rows of blocks, between subspaces that the last sweep has not turned.

    Directions of eigenvalues of the same size go on turning, or settle slowly, and stay in one block.
    """
    size = len(turn)
    settled = [p for p in range(1, size) if np.abs(turn[p:, :p]).max() < _SETTLED]
    return [slice(begin, end) for begin, end in pairwise([0, *settled, size])]


def _solve_block(turn: Array, sizes: Array, U: Array, rows: slice) -> tuple[Array, Array]:
    """Return logarithms of the eigenvalues of a block, and eigenvectors in the basis, (D, block)."""
    base = sizes[rows].max()
    block = turn[rows, rows] @ (np.exp(sizes[rows] - base)[:, None] * U[rows, rows])
    values, inside = np.linalg.eig(block)
    logarithms = base + np.log(values.astype(complex))
    vectors = np.zeros((len(sizes), len(values)), dtype=complex)
    vectors[rows] = inside
    before = slice(0, rows.start)
    for i, logarithm in enumerate(logarithms if rows.start else []):
        # rows before: U x − μ S⁻¹ Wᵀ x = −U y
        left = U[before, before] - np.exp(logarithm - sizes[before])[:, None] * turn[before, before].T
        vectors[before, i] = np.linalg.solve(left, -U[before, rows] @ inside[:, i])
    return logarithms, vectors
