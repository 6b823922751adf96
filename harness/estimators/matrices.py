"""Small matrices without BLAS, which orders sums by the machine."""

from __future__ import annotations

import numpy as np

from wayproof.harness.estimators.kernels.symmetric import solve
from wayproof.models.arrays import Array


def inverse(matrix: Array) -> Array:
    """Return the inverse of a positive definite matrix (n, n), by Cholesky."""
    columns = []
    for column in np.eye(len(matrix)):
        solve(matrix.copy(), column)
        columns.append(column)
    result = np.array(columns)
    symmetric: Array = 0.5 * (result + result.T)
    return symmetric


def product(one: Array, other: Array) -> Array:
    """Return the matrix product of (n, k) and (k, m)."""
    sums: Array = (one[:, :, None] * other[None, :, :]).sum(axis=1)
    return sums


def projected(symmetric: Array, matrix: Array) -> Array:
    """Return the product A B A of a symmetric A, both (n, n)."""
    return product(product(symmetric, matrix), symmetric)
