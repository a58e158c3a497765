"""Poses of viser's nodes, compared as plain numbers.

viser compares each new position and quaternion with the present one by numpy's `allclose`, which
takes 30 µs for three numbers: a sixth of the web process while a page shows a flight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from viser import _scene_handles

RELATIVE, ABSOLUTE = 1e-5, 1e-8
"""Tolerances of `allclose`."""


def compare_as_numbers() -> None:
    """Make every viser server of this process set poses by `set_pose_vector`."""
    _scene_handles._set_pose_vector = set_pose_vector


def set_pose_vector(
    current: np.ndarray[Any, Any],
    value: Any,
    length: int,
    queue: Callable[[Any], None],
    make_message: Callable[[Any], Any],
) -> None:
    """Store a position or a quaternion in `current`, and queue its message, unless it is close to
    the present one. Raises ValueError for another number of components.
    """
    numbers = tuple(map(float, value))
    if len(numbers) != length:
        raise ValueError(f"{length} numbers are needed, not {len(numbers)}")
    before = current.tolist()
    if all(
        abs(new - old) <= ABSOLUTE + RELATIVE * abs(old)
        for new, old in zip(numbers, before, strict=True)
    ):
        return
    current[:] = numbers
    queue(make_message(numbers))
