"""Fixed layouts have the bytes that rosbags would write."""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
import pytest

from quadrotor.errors import LinkError
from vehicle_link.messages import encode, new
from vehicle_link.messages.cdr_layout import FixedLayout, payloads_of

SEED = 20111

CASES: dict[str, tuple[dict[str, str], dict[str, int]]] = {
    "nav_msgs/Odometry": ({"header.frame_id": "world", "child_frame_id": "quad1/body"}, {}),
    "quadlab_msgs/Reference": ({"header.frame_id": "w"}, {}),
    "quadlab_msgs/Actuators": ({"header.frame_id": "quad1/body"}, {}),
    "quadlab_msgs/EstimatorStatus": ({"estimator": "complementary"}, {}),
    "quadlab_msgs/Heartbeat": ({}, {}),
    "quadlab_msgs/Telemetry": ({}, {"offsets_ns": 3, "samples": 150}),
    "quadlab_msgs/SensorReading": ({"sensor": "height"}, {}),
    "sensor_msgs/BatteryState": ({"serial_number": "7", "location": "ab"}, {"cell_voltage": 3}),
    "sensor_msgs/FluidPressure": ({}, {}),
    "sensor_msgs/Imu": ({"header.frame_id": ""}, {}),
    "sensor_msgs/Joy": ({}, {"axes": 4, "buttons": 1}),
    "geometry_msgs/PoseStamped": ({"header.frame_id": "world"}, {}),
    "geometry_msgs/PoseWithCovarianceStamped": ({"header.frame_id": "wor"}, {}),
}


def _random(layout: FixedLayout, count: int, rng: np.random.Generator) -> Any:
    """Return records with random values in every field of every message."""
    records = layout.new(count)
    for name in layout.dtype.names or ():
        shape, dtype = records[name].shape, layout.dtype[name].base
        values = rng.uniform(-1e3, 1e3, shape) if dtype.kind == "f" else rng.integers(0, 2, shape)
        records[name] = values.astype(dtype)
    return records


def _as_message(type_name: str, record: np.void, strings: dict[str, str]) -> Any:
    """Return the same content as a rosbags message, built without offsets."""
    message = new(type_name)
    for path, text in strings.items():
        *owners, field = path.split(".")
        setattr(reduce(getattr, owners, message), field, text)
    for path in record.dtype.names or ():
        *owners, field = path.split(".")
        owner = reduce(getattr, owners, message)
        current, value = getattr(owner, field), record[path]
        if hasattr(current, "__msgtype__"):
            names = [name for name in current.__dataclass_fields__ if name != "__msgtype__"]
            for name, number in zip(names, value.tolist(), strict=True):
                setattr(current, name, number)
        else:
            setattr(owner, field, value.copy() if np.ndim(value) else value.item())
    return message


@pytest.mark.parametrize("type_name", CASES)
def test_layout_gives_the_bytes_of_rosbags(type_name: str) -> None:
    strings, lengths = CASES[type_name]
    layout = FixedLayout(type_name, strings, lengths)
    print("seed", SEED)
    records = _random(layout, 5, np.random.default_rng(SEED))
    payloads = payloads_of(records)
    assert len(payloads) == 5
    for record, payload in zip(records, payloads, strict=True):
        assert payload == encode(_as_message(type_name, record, strings))


@pytest.mark.parametrize("type_name", CASES)
def test_what_was_encoded_is_decoded(type_name: str) -> None:
    layout = FixedLayout(type_name, *CASES[type_name])
    print("seed", SEED)
    records = _random(layout, 3, np.random.default_rng(SEED))
    payloads = payloads_of(records)
    assert layout.decode(payloads[1]) == records[1]
    np.testing.assert_array_equal(layout.decode_many(payloads), records)


def test_a_field_of_equal_numbers_has_an_axis() -> None:
    layout = FixedLayout("nav_msgs/Odometry")
    records = layout.new(2)
    assert records["pose.pose.orientation"].shape == (2, 4)
    assert records["pose.covariance"].shape == (2, 36)
    assert records["header.stamp.sec"].dtype == np.int32


def test_other_texts_or_lengths_do_not_fit() -> None:
    layout = FixedLayout("geometry_msgs/PoseStamped", {"header.frame_id": "world"})
    foreign = encode(new("geometry_msgs/PoseStamped", header={"frame_id": "optic"}))
    assert len(foreign) == layout.size
    assert not layout.fits(foreign)
    with pytest.raises(LinkError, match="do not have the layout of geometry_msgs/PoseStamped"):
        layout.decode(foreign)
    assert not layout.fits(payloads_of(layout.new())[0] + b"\x00")


def test_a_path_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no such string or sequence: \['frame'\]"):
        FixedLayout("geometry_msgs/PoseStamped", {"frame": "world"})
    with pytest.raises(ValueError, match=r"JointState\.name"):
        FixedLayout("sensor_msgs/JointState", lengths={"name": 2})
