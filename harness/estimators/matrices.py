"""Small matrices without BLAS, which orders sums by the machine."""

from __future__ import annotations

from math import sqrt

import numpy as np

from wayproof.kernel_compiler import kernel
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


@kernel
def diagonalize(matrix: Array, vectors: Array) -> None:
    """Diagonalize a symmetric matrix (3, 3) in place; its eigenvectors are the columns (3, 3).

    Cyclic Jacobi rotations (Golub and Van Loan, Matrix Computations, 4th edition, section 8.5).
    """
    for row in range(3):
        for column in range(3):
            vectors[row, column] = 1.0 if row == column else 0.0
    for _ in range(12):
        off = matrix[0, 1] ** 2 + matrix[0, 2] ** 2 + matrix[1, 2] ** 2
        if off < 1e-30:
            return
        for p in range(2):
            for q in range(p + 1, 3):
                if matrix[p, q] != 0.0:
                    rotate_away(matrix, vectors, p, q)


@kernel
def rotate_away(matrix: Array, vectors: Array, p: int, q: int) -> None:
    """Rotate in the plane of two axes so that their product vanishes."""
    slope = 0.5 * (matrix[q, q] - matrix[p, p]) / matrix[p, q]
    sign = 1.0 if slope >= 0.0 else -1.0
    t = sign / (abs(slope) + sqrt(slope * slope + 1.0))
    c = 1.0 / sqrt(t * t + 1.0)
    s = t * c
    for row in range(3):
        x, y = matrix[row, p], matrix[row, q]
        matrix[row, p], matrix[row, q] = c * x - s * y, s * x + c * y
    for column in range(3):
        x, y = matrix[p, column], matrix[q, column]
        matrix[p, column], matrix[q, column] = c * x - s * y, s * x + c * y
    for row in range(3):
        x, y = vectors[row, p], vectors[row, q]
        vectors[row, p], vectors[row, q] = c * x - s * y, s * x + c * y


@kernel
def solve(matrix: Array, right: Array) -> None:
    """Solve a positive definite system (n, n) by Cholesky in place; the solution is `right`."""
    size = len(right)
    for j in range(size):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = sqrt(max(matrix[j, j], 1e-12))
        for i in range(j + 1, size):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(size):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
