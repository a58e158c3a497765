"""Random starts of a formation, apart from each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SPREAD, APART = 1.8, 1.35
"""m, half the side of the square of the starts, and their smallest distance."""


def random_starts(
    places: npt.NDArray[np.float64], seed: int, crossing: bool = False
) -> list[tuple[float, float]]:
    """Return x and y (m) where each vehicle starts.

    Who starts where is planned so that the paths to the places of the formation do not cross: of
    all ways to share the starts out, the one with the least sum of squared paths; `crossing` takes
    the one with the greatest.
    """
    from scipy.optimize import linear_sum_assignment

    random = np.random.Generator(np.random.PCG64(seed))
    found: list[npt.NDArray[np.float64]] = []
    while len(found) < len(places):
        found = []
        for _ in range(200):
            one = random.uniform(-SPREAD, SPREAD, 2)
            if all(np.linalg.norm(one - other) >= APART for other in found):
                found.append(one)
            if len(found) == len(places):
                break
    starts = np.array(found)
    away = starts - starts.mean(axis=0)
    flat = places[:, :2] * np.sqrt((away**2).sum() / (places[:, :2] ** 2).sum())
    cost = ((flat[:, None] - away[None]) ** 2).sum(axis=2)
    _, chosen = linear_sum_assignment(cost, maximize=crossing)
    return [(round(float(x), 3), round(float(y), 3)) for x, y in starts[chosen]]


def starts_near(
    places: npt.NDArray[np.float64], seed: int, near: float
) -> list[tuple[float, float]]:
    """Return x and y (m) of starts within `near` of the formation, as large as keeps them APART."""
    random = np.random.Generator(np.random.PCG64(seed))
    i, j = np.triu_indices(len(places), 1)
    flat = places[:, :2]
    size = (APART + 2.0 * near) / np.linalg.norm(flat[i] - flat[j], axis=1).min()
    starts = size * flat + random.uniform(-near, near, flat.shape)
    return [(round(float(x), 3), round(float(y), 3)) for x, y in starts]
