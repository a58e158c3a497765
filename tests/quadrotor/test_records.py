"""The records of the tick."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from quadrotor.records import (
    ACTUATORS,
    ESTIMATE,
    IMU_SAMPLE,
    POSE_SAMPLE,
    REFERENCE,
    STATE,
    STATUS,
    TICK,
    Record,
    new_reference,
    new_state,
    new_tick,
)

ALL = [STATE, REFERENCE, IMU_SAMPLE, POSE_SAMPLE, ACTUATORS, ESTIMATE, STATUS, TICK]


@pytest.mark.parametrize("make", [new_state, new_reference, new_tick])
def test_a_new_record_is_one_and_at_rest(make: Callable[[], Record]) -> None:
    record = make()
    assert record.shape == (1,)
    if make is not new_reference:
        state = record if make is new_state else record["state"]
        assert state["quaternion_wb"].tolist() == [[1.0, 0.0, 0.0, 0.0]]


def test_a_new_tick_has_not_yet_seen_a_pose() -> None:
    assert np.isposinf(new_tick()["estimate"]["measurement_age"][0])


def test_states_and_references_are_nothing_but_doubles() -> None:
    # The code views them as (13,) and (18,) float arrays.
    for dtype, size in ((STATE, 13), (REFERENCE, 18)):
        assert dtype.itemsize == 8 * size
        assert np.zeros(1, dtype).view("f8").shape == (size,)


def test_parts_of_a_tick_are_views_into_it() -> None:
    tick = new_tick()
    tick["state"]["position_w"][0] = (1.0, 2.0, 3.0)
    tick["imu"]["stamp_ns"] = 42
    assert tick[0]["state"]["position_w"].tolist() == [1.0, 2.0, 3.0]
    assert tick[0]["imu"]["stamp_ns"] == 42
    assert tick["reference"].flags.c_contiguous


@pytest.mark.parametrize("dtype", ALL)
def test_a_record_survives_as_bytes(dtype: np.dtype[np.void]) -> None:
    rng = np.random.default_rng(dtype.itemsize)
    print(f"seed {dtype.itemsize}")
    raw = rng.integers(0, 255, size=3 * dtype.itemsize, dtype=np.uint8)
    record = np.frombuffer(raw.tobytes(), dtype)
    assert np.frombuffer(record.tobytes(), dtype).tobytes() == record.tobytes()
    assert dtype.isalignedstruct
