"""Every number that is logged can be charted, once, with the value in its message."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from console.exchange.subscriptions import RECORDED_AS_RECEIVED
from console.link.outbox import RECORDED
from tests.support.live_signals import Received, ticks_of
from vehicle_link.messages import decode, encode, new
from vehicle_link.messages.records import Message
from vehicle_link.messages.units import Path, numbers
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import TICK_TOPICS
from web.latest import STALE
from web.signals import INDEX, NAMED, SIGNALS, described
from web.signals.estimates import COMPARED
from web.signals.plain import MEMBERS

TEXT = {"events", "parameter_changes"}
"""Topics with lines, not values over time."""
DRAWN = {"neighbour_bearings"}
"""Topics that are drawn in 3D; their one number, the noise, is a parameter."""
LOGGED = ({*RECORDED_AS_RECEIVED, *RECORDED, *TICK_TOPICS}) - TEXT - DRAWN
WITH_NUMBERS = {topic for topic in LOGGED if numbers(TOPICS[topic].type_name, 0)}


def values_with(topic: str, message: Any) -> dict[str, float]:
    received = Received()
    received.put(topic, message)
    return received.newest()


def filled(type_name: str) -> Any:
    """Return a message whose numbers are all different and not zero."""
    message = new(type_name)
    for i, (path, _) in enumerate(numbers(type_name, 0)):
        *outer, last = path
        place: Any = message
        for step in outer:
            place = place[step] if isinstance(step, int) else getattr(place, step)
        if isinstance(last, int):
            place[last] = i + 1.5
        else:
            old = getattr(place, last)
            setattr(place, last, type(old)(i + 1.5))
    return message


def number_at(message: Message, path: Path) -> float:
    """Return the number at a path; NaN where an array is too short."""
    value: Any = message
    for step in path:
        if not isinstance(step, int):
            value = getattr(value, step)
        elif step < len(value):
            value = value[step]
        else:
            return math.nan
    return float(value)


@pytest.mark.parametrize("topic", sorted(WITH_NUMBERS - TICK_TOPICS.keys()))
def test_every_number_of_a_logged_topic_can_be_charted(topic: str) -> None:
    found = numbers(TOPICS[topic].type_name, 0)
    assert topic in STALE
    message = filled(TOPICS[topic].type_name)
    received = Received()
    received.ticks(ticks_of(3, rate=1e4, start=-1e-4))
    received.put(topic, message)
    shown = [v for v in received.newest().values() if math.isfinite(v)]
    for path, _ in found:
        number = number_at(decode(encode(message), TOPICS[topic].type_name), path)
        scales = (1.0, 1e2, 1e3, 1e6, math.degrees(1.0))  # %, mm or ms, µs, degrees
        assert any(math.isclose(number * k, v, rel_tol=1e-6) for v in shown for k in scales), path


@pytest.mark.parametrize("topic", sorted(TICK_TOPICS))
def test_every_number_of_a_tick_can_be_charted(topic: str) -> None:
    received, ticks = Received(), ticks_of(1)
    whole = ticks.view(np.uint8).copy()
    for part in ("state", "reference", "actuators"):
        runs = ticks[part].dtype
        ticks[part] = np.arange(1.0, runs.itemsize / 8 + 1).view(runs)
    ticks["imu"]["specific_force_b"], ticks["imu"]["angular_velocity_b"] = 7.5, 8.5
    assert (ticks.view(np.uint8) != whole).any()
    received.ticks(ticks)
    message, shown = received.live.newest(topic), list(received.newest().values())
    assert message is not None
    for path, _ in numbers(TOPICS[topic].type_name, 0):
        number = number_at(message, path)
        scales = (1.0, math.degrees(1.0))
        assert any(math.isclose(number * k, v, rel_tol=1e-6) for v in shown for k in scales), path


def test_a_plain_signal_is_the_number_of_its_field() -> None:
    received, ticks = Received(), ticks_of(1)
    ticks["imu"]["specific_force_b"] = (1.0, 2.0, 9.5)
    received.ticks(ticks)
    now = received.newest()
    assert [now[f"imu.linear_acceleration.{a}"] for a in "xyz"] == [1.0, 2.0, 9.5]
    signal = SIGNALS[INDEX["imu.linear_acceleration.z"]]
    assert (signal.unit, signal.group, signal.label) == ("m/s²", "linear acceleration", "z")


def test_consistency_is_told_a_number_and_deviations_as_lengths() -> None:
    told = new(
        "quadlab_msgs/EstimatorStatus",
        nis=12.0,
        nis_freedom=8,
        position_variance=(4e-4, 4e-4, 1e-4),
        attitude_variance=(math.radians(0.5) ** 2, 0.0, 0.0),
    )
    now = values_with("estimator", told)
    assert now["nis"] == 1.5
    assert now["deviation.position"] == pytest.approx(30.0)
    assert now["deviation.attitude"] == pytest.approx(0.5)
    assert now["deviation.heading"] == 0.0
    told.nis_freedom = 0  # the newest was refused, or there is no covariance
    assert math.isnan(values_with("estimator", told)["nis"])


def test_units_are_inherited_by_what_is_nested() -> None:
    assert SIGNALS[INDEX["tracker_pose.pose.position.x"]].unit == "m"
    assert SIGNALS[INDEX["state.twist.twist.linear.x"]].unit == "m/s"
    assert SIGNALS[INDEX["tracker_pose.pose.orientation.w"]].unit == ""


def test_an_array_that_is_shorter_gives_no_number() -> None:
    now = values_with("joy", new("sensor_msgs/Joy", axes=(0.5, -0.25), buttons=[1]))
    assert (now["joy.axes.0"], now["joy.axes.1"], now["joy.buttons.0"]) == (0.5, -0.25, 1.0)
    assert all(math.isnan(now[f"joy.axes.{i}"]) for i in range(2, MEMBERS))


def test_true_and_false_are_one_and_zero() -> None:
    now = values_with("status", new("quadlab_msgs/VehicleStatus", armed=True))
    assert (now["status.armed"], now["status.airborne"]) == (1.0, 0.0)


def test_every_field_of_a_compared_estimator_is_found_by_its_name() -> None:
    results = [
        new("quadlab_msgs/EstimatorResult", name=name, velocity=(i, 0.0, 0.0))
        for i, name in enumerate(reversed(COMPARED))
    ]
    message = new("quadlab_msgs/EstimatorComparison", estimators=results[1:])
    now = values_with("comparison", message)
    assert now[f"comparison.{COMPARED[0]}.velocity.x"] == len(COMPARED) - 1
    assert math.isnan(now[f"comparison.{COMPARED[-1]}.velocity.x"]), "it did not come"


def test_named_signals_come_first_and_nothing_has_two() -> None:
    assert SIGNALS[0].name == "state.position.x"
    assert "state.pose.pose.position.x" not in INDEX
    assert "link_status.loss" not in INDEX
    assert [s.name for s in SIGNALS[:NAMED]] == list(dict.fromkeys(s.name for s in SIGNALS[:NAMED]))
    assert SIGNALS[NAMED].name.split(".")[0] in STALE


def test_the_list_for_the_page_is_small() -> None:
    assert len(described()) < 150_000
