"""Products and solutions of small dense matrices, without allocation."""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Array


@compiled(inner=True)
def solve(H: Array, K: Array, columns: int) -> None:
    """Replace K by H^-1 K for a positive definite H, which is overwritten.

    Args:
        H: (N, N). K: (N, M), of which the first `columns` are replaced.
    """
    rows = H.shape[0]
    for i in range(rows):
        for j in range(i + 1):
            value = H[i, j]
            for n in range(j):
                value -= H[i, n] * H[j, n]
            H[i, j] = math.sqrt(value) if i == j else value / H[j, j]
    for c in range(columns):
        for i in range(rows):
            for n in range(i):
                K[i, c] -= H[i, n] * K[n, c]
            K[i, c] /= H[i, i]
        for i in range(rows - 1, -1, -1):
            for n in range(i + 1, rows):
                K[i, c] -= H[n, i] * K[n, c]
            K[i, c] /= H[i, i]


@compiled(inner=True)
def multiply_into(X: Array, Y: Array, out: Array) -> None:
    """Write the product X Y into out."""
    for i in range(X.shape[0]):
        for j in range(Y.shape[1]):
            value = 0.0
            for n in range(X.shape[1]):
                value += X[i, n] * Y[n, j]
            out[i, j] = value
