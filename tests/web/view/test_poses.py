"""Poses are set as viser sets them: the same messages, and none for what has not changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from viser import _scene_handles

from web.view.poses import set_pose_vector

_set_by_viser: Any = _scene_handles._set_pose_vector


@pytest.mark.parametrize(
    "value",
    [
        (0.0, 0.0, 0.0),
        (1.0, -2.0, 3.0),
        np.array([1.0, -2.0, 3.0 + 2.9e-5], np.float32),
        (1.0 + 1e-9, -2.0, 3.0),
        (1.0 + 2e-5, -2.0, 3.0),
        (1.0, -2.0, float("nan")),
    ],
)
def test_a_pose_is_stored_and_sent_exactly_when_viser_would(value: Any) -> None:
    found = []
    for setter in (_set_by_viser, set_pose_vector):
        current, sent = np.array([1.0, -2.0, 3.0]), list[Any]()
        setter(current, value, 3, sent.append, tuple)
        found.append((current.tobytes(), repr(sent)))
    assert found[0] == found[1]


def test_a_vector_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match="3 numbers are needed, not 2"):
        set_pose_vector(np.zeros(3), (1.0, 2.0), 3, list[Any]().append, tuple)
