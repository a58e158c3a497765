"""Robust least squares over segments of a log, each with its own nuisance unknowns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from quadrotor.records import Array

ROBUST = 3.0
"""Multiple of the median residual beyond which a pose has less weight."""


@dataclass(frozen=True)
class SegmentedFit:
    values: Array
    deviations: Array
    weights: Array  # (N,)
    rms: float
    parts: Array  # rms of each segment


def solve_segments(
    columns: Array,
    rest: Array,
    parts: list[Any],
    bases: list[Array],
    prior: tuple[float, ...],
    weights: Array | None,
) -> SegmentedFit:
    """Return x that minimises rest + columns @ x, up to each segment's own basis.

    Args:
        columns: (N, 3, K).
        rest: (N, 3).
        parts: rows of each segment.
        bases: of each segment, (n, B).
        prior: standard deviations of x before the fit, K.
        weights: (N,) of an earlier round.
    """
    weights = np.ones(len(rest)) if weights is None else weights
    left, right = [], []
    for rows, basis in zip(parts, bases, strict=True):
        w = weights[rows][:, None]
        table = np.concatenate([columns[rows], rest[rows][..., None]], axis=2)
        flat = table.reshape(len(rows), -1)
        own = np.linalg.lstsq(np.sqrt(w) * basis, np.sqrt(w) * flat, rcond=None)[0]
        table = (flat - basis @ own).reshape(table.shape)
        left.append(table[..., :-1])
        right.append(table[..., -1])
    every = np.concatenate(parts)
    J, y, w = np.concatenate(left), np.concatenate(right), weights[every]
    x, residual = np.zeros(J.shape[2]), y
    for _ in range(2):  # the second with the noise that remains after the first
        variance = max(float(np.average((residual**2).mean(axis=1), weights=w)), 1e-18)
        A = np.einsum("n,nik,nil->kl", w / variance, J, J) + np.diag(np.square(prior) ** -1.0)
        x = -np.linalg.solve(A, np.einsum("n,nik,ni->k", w / variance, J, y))
        residual = y + J @ x
    ends = np.cumsum([len(rows) for rows in parts])[:-1]
    gradient = np.einsum("n,nik,ni->nk", w / variance, J, residual)
    clusters = np.array([one.sum(axis=0) for one in np.split(gradient, ends)])
    inverse = np.linalg.inv(A)
    noise = clusters.T @ clusters + np.diag(np.square(prior) ** -1.0)
    length = np.linalg.norm(residual, axis=1)
    new = np.zeros(len(rest))
    new[every] = np.minimum(1.0, ROBUST * np.median(length) / np.maximum(length, 1e-12))
    return SegmentedFit(
        x,
        np.sqrt(np.diag(inverse @ noise @ inverse)),
        new,
        math.sqrt(variance),
        np.array([np.sqrt((one**2).mean()) for one in np.split(residual, ends)]),
    )
