"""Explanation of a flight: claims with their figures, and none below the limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from console.evaluation.findings import Finding, explain
from flight_log.fields import (
    ATTITUDE,
    FORCE,
    MARKED,
    POSITION,
    RATE,
    REFERENCE,
    THRUSTS,
    TRACKED,
    TRACKED_ATTITUDE,
)
from flight_log.run import Series

END = 40.0
TIMES = {rate: np.arange(0.0, END, 1.0 / rate) for rate in (2, 10, 50, 100, 500)}
THRUST = 3.2
COLUMNS = {
    "imu": FORCE,
    "state": (*POSITION, *ATTITUDE),
    "tracker_pose": (*TRACKED, *TRACKED_ATTITUDE),
    "tracker_position": MARKED,
    "reference": REFERENCE,
    "actuators": (*THRUSTS, "scaling"),
    "estimator": ("measurement_age", "consistency", "refused_share"),
    "status": ("airborne", "flags", "suspect_offset", "suspect_beacon"),
    "battery": ("voltage",),
}
"""Fields by topic from which flights are explained."""


class Made(Series):
    """Topic with given columns."""

    def __init__(self, rate: int, columns: Mapping[str, Any], flags: Any = ()) -> None:
        self.time, self._flags = TIMES[rate], list(flags)
        self._values = {
            name: np.broadcast_to(np.asarray(values, np.float32), self.time.shape)
            for name, values in columns.items()
        }

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def cut(self, count: int) -> Made:
        """Return only the first rows."""
        short = Made(2, {}, self._flags)
        short.time = self.time[:count]
        short._values = {name: values[:count] for name, values in self._values.items()}
        return short

    def values(self, name: str, first: int = 0, last: int | None = None) -> Any:
        return self._values[name][first:last]

    def changes(self, path: str) -> list[tuple[float, str]]:
        return self._flags


def flight(**changed: Mapping[str, Any]) -> dict[str, Made]:
    """Return a hover without faults, some of its columns changed: `topic={column: values}`."""
    rates = {"imu": 500, "state": 500, "reference": 500, "actuators": 500, "tracker_pose": 100}
    rates |= {"estimator": 50, "status": 10, "battery": 2}
    plain: dict[str, dict[str, Any]] = {
        "estimator": {"consistency": 1.0},
        "battery": {"voltage": 15.2},
    }
    plain |= {"state": {ATTITUDE[0]: 1.0}, "tracker_pose": {TRACKED_ATTITUDE[0]: 1.0}}
    plain |= {"actuators": {**{f"thrusts[{k}]": THRUST for k in range(4)}, "scaling": 1.0}}
    plain |= {"status": {"airborne": (TIMES[10] > 5.0) & (TIMES[10] < 35.0)}}
    made: dict[str, Made] = {}
    for topic, rate in rates.items():
        given: dict[str, Any] = {name: 0.0 for name in COLUMNS[topic] if name != "flags"}
        given |= {**plain.get(topic, {}), **changed.get(topic, {})}
        flags = given.pop("flags", ())
        made[topic] = Made(rate, given, flags)
    return made


def during(rate: int, start: float, end: float, value: float, usual: float = 0.0) -> Any:
    time = TIMES[rate]
    return np.where((time >= start) & (time < end), value, usual)


def turned_by(yaw: float) -> dict[str, Any]:
    """Return attitudes turned about z by an angle (deg)."""
    half = np.radians(yaw) / 2.0
    return {TRACKED_ATTITUDE[0]: np.cos(half), TRACKED_ATTITUDE[3]: np.sin(half)}


ON_BEARINGS = [(0.0, ""), (10.0, "on_bearings")]
NOISE = np.random.default_rng(1).normal(size=len(TIMES[500]))
FAULTS: dict[str, tuple[dict[str, Any], dict[str, Any], float, str]] = {
    # kind: columns with the fault, columns just below the limit, weight, figure in the claim
    "motor_weak": (
        {"actuators": {"thrusts[2]": during(500, 15.0, 40.0, 1.12 * THRUST, THRUST)}},
        {"actuators": {"thrusts[2]": 1.05 * THRUST}},
        2.0,
        "rear motor needed 12 %",
    ),
    "motor_strong": (
        {"actuators": {"thrusts[2]": during(500, 15.0, 40.0, 0.88 * THRUST, THRUST)}},
        {"actuators": {"thrusts[2]": 0.95 * THRUST}},
        2.0,
        "rear motor needed 12 % less",
    ),
    "vibration": (
        {"imu": {"linear_acceleration.x": 5.0 * NOISE}},
        {"imu": {"linear_acceleration.x": 2.4 * NOISE}},
        2.0,
        "m/s² rms",
    ),
    "tracker_late": (
        {"estimator": {"measurement_age": during(50, 15.0, 40.0, 0.09)}},
        {"estimator": {"measurement_age": 0.028}},
        3.0,
        "90 ms old",
    ),
    "tracker_outliers": (
        {"tracker_pose": {"pose.position.x": np.where(np.arange(4000) % 10 == 0, 0.5, 0.0)}},
        {"tracker_pose": {"pose.position.x": np.where(np.arange(4000) % 100 == 0, 0.5, 0.0)}},
        5.0,
        "10 % of",
    ),
    "beacon_off": (
        {
            "status": {
                "flags": [(0.0, ""), (15.0, "on_bearings, beacon_off")],
                "suspect_offset": np.radians(4.0),
                "suspect_beacon": 3.0,
            }
        },
        {"status": {"flags": [(0.0, "on_bearings")]}},
        4.0,
        "beacon 3 were 4.0°",
    ),
    "bearings_disagree": (
        {"status": {"flags": ON_BEARINGS}, "tracker_pose": turned_by(3.0)},
        {"status": {"flags": ON_BEARINGS}, "tracker_pose": turned_by(1.4)},
        2.0,
        "by 3.0° and moved by 0.00 m",
    ),
    "link_lost": (
        {"status": {"flags": [(0.0, ""), (15.0, "link_lost"), (17.0, "")]}},
        {"status": {"flags": [(0.0, "link_lost"), (3.0, "")]}},
        6.0,
        "2.4 s",
    ),
    "battery_sag": (
        {"battery": {"voltage": during(2, 20.0, 35.0, 13.45, 15.0) + (TIMES[2] < 6.0)}},
        {"battery": {"voltage": 13.9}},
        1.5,
        "13.4 V",
    ),
    "off_reference": (
        {"reference": {"position.y": during(500, 15.0, 17.0, 0.5)}},
        {"reference": {"position.y": 0.24}},
        2.0,
        "0.50 m",
    ),
    "saturation": (
        {"actuators": {"scaling": during(500, 15.0, 17.0, 0.4, 1.0)}},
        {"actuators": {"scaling": during(500, 15.0, 15.05, 0.4, 1.0)}},
        10.0,
        "0.40",
    ),
    "estimate_inconsistent": (
        {"estimator": {"consistency": during(50, 15.0, 20.0, 12.0, 1.0)}},
        {"estimator": {"consistency": 3.0}},
        3.0,
        "12.0 times",
    ),
    "at_bound": (
        {"status": {"flags": [(0.0, ""), (15.0, "at_bound"), (20.0, "")]}},
        {"status": {"flags": [(0.0, "at_bound"), (3.0, "")]}},
        5.0,
        "5.0 s",
    ),
    "oscillating": (
        {
            "status": {
                "flags": [(0.0, ""), (15.0, "oscillating"), (20.0, "")],
                "oscillation_frequency": during(10, 15.0, 20.0, 0.7),
            }
        },
        {"status": {"flags": [(0.0, "oscillating"), (3.0, "")]}},
        5.0,
        "at 0.7 Hz for 5.0 s",
    ),
    **{
        flag: (
            {"status": {"flags": [(0.0, ""), (15.0, flag), (17.0, "")]}},
            {"status": {"flags": [(0.0, flag), (3.0, "")]}},
            20.0,
            "2.0 s",
        )
        for flag in ("tracker_contradicted", "inertial_suspect", "tracker_tilted")
    },
    "tilted": (
        {"state": {"pose.pose.orientation.x": during(500, 33.0, 33.2, np.sqrt(0.5))}},
        {"state": {"pose.pose.orientation.x": 0.5}, "tracker_pose": {"pose.orientation.x": 0.5}},
        90.0 / 70.0,
        "90°",
    ),
}


def test_a_bias_at_its_bound_is_named_without_the_flag() -> None:
    biases = {f"gyroscope_bias.{axis}": 0.0 for axis in "xyz"}
    held = biases | {"gyroscope_bias.y": during(50, 10.0, 20.0, -0.05)}
    limit = {"estimation.gyroscope_bias_limit": 0.05}
    [found] = explain(flight(estimator=held), limit)
    assert (found.kind, found.start) == ("at_bound", 10.0)
    assert "estimation.gyroscope_bias_limit" in found.claim
    assert explain(flight(estimator=held), {"estimation.gyroscope_bias_limit": 0.06}) == []


def explained(columns: dict[str, Any]) -> list[Finding]:
    limits = {"safety.battery_warning": 13.8, "safety.battery_land": 13.1}
    return explain(flight(**columns), limits)


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_named_with_its_figure_and_nothing_below_its_limit(kind: str) -> None:
    fault, harmless, weight, figure = FAULTS[kind]
    assert explained(harmless) == []
    [found] = explained(fault)
    assert (found.kind, figure in found.claim) == (kind, True), found.claim
    assert found.weight == pytest.approx(weight, rel=0.1)
    assert len(found.time) == len(found.values) > 0
    assert 5.0 < found.start < found.end < END


def test_a_step_or_doublet_that_moves_the_vehicle_away_is_nothing() -> None:
    doublet = {"reference": {"position.y": during(500, 15.0, 17.0, 0.3)}}
    behaviors = [(0.0, "hover"), (14.5, "excite"), (16.5, "brake")]
    assert explained(doublet | {"status": {"flags": behaviors}}) == []
    behaviors = [(0.0, "hover"), (20.0, "excite"), (22.0, "brake")]
    [found] = explained(doublet | {"status": {"flags": behaviors}})
    assert found.kind == "off_reference"


def test_a_silent_tracker_is_named_and_stands_behind_the_link_that_was_lost() -> None:
    topics = flight()
    poses = topics["tracker_pose"]
    poses.time = np.where(poses.time < 20.0, poses.time, poses.time + 0.8)
    [found] = explain(topics, {})
    assert (found.kind, found.follows) == ("tracker_gaps", False)
    assert found.weight == pytest.approx(0.81 / 0.2, rel=0.01)
    marker = Made(100, dict.fromkeys(MARKED, 0.0))
    marker.time = poses.time
    alone = {name: topic for name, topic in topics.items() if name != "tracker_pose"}
    [same] = explain({**alone, "tracker_position": marker}, {})
    assert (same.kind, same.weight) == (found.kind, found.weight)
    lost = flight(status={"flags": [(0.0, ""), (20.4, "link_lost"), (20.8, "")]})
    kinds = [one.kind for one in explain({**lost, "tracker_pose": poses}, {})]
    assert kinds == ["link_lost", "tracker_gaps"]


def test_a_gap_stands_behind_a_lost_link_only_where_it_was_lost_in_the_gap() -> None:
    lost = flight(status={"flags": [(0.0, ""), (10.0, "link_lost"), (10.4, "")]})
    poses = lost["tracker_pose"]
    poses.time = np.where(poses.time < 20.0, poses.time, poses.time + 0.8)
    assert [one.follows for one in explain(lost, {}) if one.kind == "tracker_gaps"] == [False]


def test_vibration_that_has_grown_is_named_below_the_limit_of_one_that_is_always_there() -> None:
    grown = during(500, 20.0, 21.5, 1.2, 0.05) * NOISE
    [found] = explained({"imu": {"linear_acceleration.x": grown}})
    assert (found.kind, found.limit) == ("vibration", 0.8)
    assert [found.start, found.end] == pytest.approx([20.0, 21.5], abs=0.5)
    assert explained({"imu": {"linear_acceleration.x": 1.2 * NOISE}}) == []


def test_poses_whose_delay_ends_a_flight_within_some_seconds_are_named() -> None:
    flown = (TIMES[10] > 5.0) & (TIMES[10] < 13.0)
    [found] = explained(
        {
            "status": {"airborne": flown},
            "estimator": {"measurement_age": during(50, 10.2, 40.0, 0.13)},
        }
    )
    assert found.kind == "tracker_late"


def test_a_stronger_motor_is_named_in_a_flight_that_yaws_to_and_fro() -> None:
    # 10 s from side to side; the torque is taken from two motors and given to the other two.
    turn, inertia, ratio = 2.0 * np.pi / 20.0, 0.025, 0.016
    rate = -2.0 * np.sin(turn * TIMES[500])
    yaw = -2.0 * turn * np.cos(turn * TIMES[500]) * inertia / (4.0 * ratio)
    strong = during(500, 15.0, 40.0, 0.9, 1.0)
    thrusts = {f"thrusts[{k}]": THRUST + yaw * (1.0, -1.0)[k % 2] for k in range(4)}
    thrusts["thrusts[2]"] *= strong
    known = {"model.inertia_zz": inertia, "model.torque_ratio": ratio}
    topics = flight(actuators=thrusts, imu={RATE[2]: rate})
    [found] = [one for one in explain(topics, known) if not one.follows]
    assert (found.kind, "The rear motor needed 10 % less" in found.claim) == ("motor_strong", True)


def test_two_flights_in_a_log_are_not_one_finding() -> None:
    weak = {"thrusts[2]": during(500, 11.0, 40.0, 1.12 * THRUST, THRUST)}
    flown = (TIMES[10] > 5.0) & (TIMES[10] < 19.0) | (TIMES[10] > 23.0) & (TIMES[10] < 37.0)
    [found] = explained({"actuators": weak, "status": {"airborne": flown}})
    assert found.kind == "motor_weak"
    assert 25.0 <= found.start < found.end <= 35.1  # the longer one, not from 11 s on


def test_a_flight_on_bearings_far_from_the_tracker_is_named_unless_one_beacon_explains_it() -> None:
    moved: dict[str, Any] = {"tracker_pose": {TRACKED[1]: 0.25}}
    [apart] = explained(moved)  # it flies on the poses
    assert (apart.kind, "0.25 m" in apart.claim) == ("tracker_moved", True)
    [found] = explained({**moved, "status": {"flags": ON_BEARINGS}})
    assert (found.kind, found.follows) == ("bearings_disagree", False)
    assert "by 0.0° and moved by 0.25 m" in found.claim
    off = {"flags": [(0.0, ""), (10.0, "on_bearings, beacon_off")], "suspect_beacon": 3.0}
    both = explained({**moved, "status": {**off, "suspect_offset": np.radians(2.0)}})
    assert [one.kind for one in both] == ["beacon_off", "bearings_disagree"]
    unknown = {**moved["tracker_pose"], TRACKED_ATTITUDE[0]: 0.0}  # poses without an attitude
    assert explained({"tracker_pose": unknown, "status": {"flags": ON_BEARINGS}}) == []


def test_a_vehicle_that_left_its_bearings_by_itself_says_why() -> None:
    back = {"flags": [(0.0, "on_bearings"), (20.0, "fell_back"), (30.0, "")]}
    topics = flight(status=back)
    [found] = explain(topics, {})
    assert (found.kind, found.start, found.end) == ("fell_back", 20.0, 30.0)
    assert found.claim == "The vehicle fell back to the tracker."
    reason = "fell back to the tracker: innovations 3.1 times their expected square, allowed 3"
    events = Made(2, {}, [(10.0, "hover by admin"), (20.0, reason)])
    [told] = explain({**topics, "events": events}, {})
    assert told.claim == f"The vehicle {reason}."


def test_the_beacon_with_the_largest_offset_is_named() -> None:
    suspects = {
        "flags": [(0.0, ""), (15.0, "beacon_off"), (30.0, "")],
        "suspect_offset": np.radians(during(10, 15.0, 20.0, 5.0, 2.0)),
        "suspect_beacon": during(10, 15.0, 20.0, 1.0, 4.0),
    }
    [found] = explained({"status": suspects})
    assert "beacon 1 were 5.0°" in found.claim


@pytest.mark.parametrize("missing", COLUMNS)
def test_a_log_without_a_topic_is_explained_by_the_others(missing: str) -> None:
    topics = {name: one for name, one in flight().items() if name != missing}
    assert explain(topics, {}) == []


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 21, 33])
def test_a_log_that_ends_at_once_is_explained(count: int) -> None:
    """The topic is shorter than the smoothing window, too; other topics may be longer."""
    topics = flight(imu={"linear_acceleration.x": 50.0 * NOISE})
    assert explain({name: one.cut(count) for name, one in topics.items()}, {}) == []
    assert explain({**topics, "imu": topics["imu"].cut(count)}, {}) == []
    assert explain({**topics, "status": topics["status"].cut(count)}, {}) == []
