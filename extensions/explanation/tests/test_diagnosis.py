"""Causes that show in the residuals of one witness against the others: their kind and figure."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from console.evaluation.findings import Finding, explain
from extensions.explanation.tests.made_flight import (
    MASS,
    PARAMETERS,
    SIGMA,
    Columns,
    Flight,
    attitudes_along,
)
from flight_log.fields import ATTITUDE, POSITION
from quadrotor.constants import GRAVITY
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

FROM = 15.0  # s
LATE = 28.0  # s, 5 s before the end


def later(time: Array, value: float) -> Array:
    """Return a value from the middle of the flight on, 0 before, (N, 1)."""
    return np.where(time >= FROM, value, 0.0)[:, None]


def explained(wrong: Callable[[Flight], object] = lambda flight: None) -> list[Finding]:
    flight = Flight()
    wrong(flight)
    return explain(flight.topics(), PARAMETERS)


def numbers(claim: str) -> list[float]:
    return [float(one) for one in re.findall(r"[-+]?\d+(?:\.\d+)?", claim)]


def accelerometer(flight: Flight) -> None:
    flight.felt += later(flight.time, 1.0) * [0.0, 0.0, 0.6]


def turned_sensor(flight: Flight) -> None:
    turned = flight.felt @ rotation_exp(np.radians([0.0, 4.0, 0.0]))
    flight.felt[flight.time >= FROM] = turned[flight.time >= FROM]


def drifting_accelerometer(flight: Flight) -> None:
    flight.felt[:, 1] += 0.1 * (flight.time - LATE).clip(0.0)


def drifting_gyroscope(flight: Flight) -> None:
    flight.rates[:, 0] += np.radians(0.3) * (flight.time - LATE).clip(0.0)


def gyroscope(flight: Flight) -> None:
    flight.rates += later(flight.time, np.radians(3.0)) * [1.0, 0.0, 0.0]


def tilted_tracker(flight: Flight) -> None:
    tilt = rotation_exp(np.radians([0.0, 3.0, 0.0]))
    after = flight.poses >= FROM
    flight.tracked[after] = flight.tracked[after] @ tilt.T
    flight.tracked_R_wb = np.where(
        after[:, None, None], tilt @ flight.tracked_R_wb, flight.tracked_R_wb
    )


def scaled_tracker(flight: Flight) -> None:
    flight.tracked *= 1.0 + later(flight.poses, 0.08)


def late_stamps(flight: Flight) -> None:
    flight.tracked -= 0.04 * flight.velocity[::5] * later(flight.poses, 1.0)


def payload(flight: Flight) -> None:
    flight.thrust *= 1.0 + later(flight.time, 0.15)[:, 0]


def wind(flight: Flight) -> None:
    """Lean against a force along -x, of which the accelerometer feels nothing but the thrust."""
    force = later(flight.time, 1.0) * [-0.8, 0.0, 0.0]
    flight.thrust = MASS * np.linalg.norm(flight.push - force, axis=1)
    leaning = rotation_exp(np.array([0.0, np.arctan(0.8 / GRAVITY), 0.0]))
    after = flight.time >= FROM
    flight.R_wb[after] = leaning @ flight.R_wb[after]
    flight.tracked_R_wb = flight.R_wb[::5]
    flight.felt[after] = np.einsum("nji,nj->ni", flight.R_wb[after], flight.push[after])
    flight.felt[after] += 0.1 * flight.chance.normal(size=(int(after.sum()), 3))


def centre(flight: Flight) -> None:
    flight.torque[:, 1] = -0.02 * flight.thrust


def swapped(flight: Flight) -> None:
    after = flight.frames >= FROM
    flight.seen[after, :2] = flight.seen[after][:, 1::-1]


def beacon(flight: Flight) -> None:
    flight.seen[:, 2] += later(flight.frames, 0.1) * [1.0, 1.0, 0.0]
    flight.seen /= np.linalg.norm(flight.seen, axis=2, keepdims=True)


def scattered(flight: Flight) -> None:
    flight.seen = flight.scattered(flight.scattered(flight.seen))


def drifting(flight: Flight) -> None:
    flight.seen = flight.scattered(flight.exact, 0.5 * SIGMA)  # as around a solved pose
    flight.tracked[:, 0] += 0.03 * (flight.poses - FROM).clip(0.0)


CAUSES: dict[str, tuple[Callable[[Flight], object], str, float, float]] = {
    # name: what is done, kind, a figure of the claim, and how near it has to be
    "accelerometer": (accelerometer, "accelerometer_off", 0.6, 0.05),
    "turned sensor": (turned_sensor, "accelerometer_off", 4.0, 0.5),
    "gyroscope": (gyroscope, "gyroscope_off", 3.0, 0.3),
    "drifting accelerometer": (drifting_accelerometer, "accelerometer_off", 0.35, 0.15),
    "drifting gyroscope": (drifting_gyroscope, "gyroscope_off", 1.0, 0.4),
    "tilted tracker": (tilted_tracker, "tracker_tilted", 3.0, 0.3),
    "scaled tracker": (scaled_tracker, "tracker_scale", 8.0, 0.7),
    "late stamps": (late_stamps, "tracker_stamps", 40.0, 4.0),
    "payload": (payload, "thrust_off", 15.0, 1.0),
    "wind": (wind, "outside_force", 0.8, 0.1),
    "centre of mass": (centre, "centre_off", 20.0, 1.0),
    "swapped beacons": (swapped, "bearings_swapped", 1.0, 0.0),
    "beacon": (beacon, "beacon_off", 3.0, 0.0),
    "scattered bearings": (scattered, "bearings_scattered", 2.6, 0.3),
    "drifting tracker": (drifting, "tracker_against_bearings", 0.5, 0.1),
}


def test_nothing_is_claimed_where_all_witnesses_agree() -> None:
    assert explained() == []


@pytest.mark.parametrize("name", CAUSES)
def test_the_cause_comes_first_with_its_figure(name: str) -> None:
    wrong, kind, figure, near = CAUSES[name]
    first, *others = explained(wrong)
    assert first.kind == kind, [one.kind for one in [first, *others]]
    assert any(abs(abs(one) - figure) <= near for one in numbers(first.text)), first.text
    assert not first.follows
    assert 0.5 < first.confidence <= 1.0, others
    assert all(one.confidence <= 0.5 for one in others)


def test_a_force_against_the_velocity_is_drag() -> None:
    def drag(flight: Flight) -> None:
        force = -0.8 * flight.velocity
        flight.push = flight.push - force
        flight.R_wb = attitudes_along(flight.push)
        flight.thrust = MASS * np.linalg.norm(flight.push, axis=1)
        flight.felt = np.einsum("nji,nj->ni", flight.R_wb, flight.push)
        flight.felt += np.einsum("nji,nj->ni", flight.R_wb, force)
        flight.felt += 0.1 * flight.chance.normal(size=flight.felt.shape)
        flight.tracked_R_wb = flight.R_wb[::5]

    found = {one.kind: one for one in explained(drag)}
    assert numbers(found["drag_off"].claim)[0] == pytest.approx(0.8, abs=0.1)
    known = PARAMETERS | {"model.drag": 0.8 * MASS}
    flight = Flight()
    drag(flight)
    assert "drag_off" not in {one.kind for one in explain(flight.topics(), known)}


def repeated(name: str, topic: str, start: float, end: float) -> list[Finding]:
    """Explain a flight in which one column keeps its value for a time."""
    topics = Flight().topics()
    series = topics[topic]
    assert isinstance(series, Columns)
    values = series.values(name).copy()
    kept = (series.time >= start) & (series.time < end)
    values[kept] = values[kept][0]
    series._values[name] = values
    return explain(topics, PARAMETERS)


@pytest.mark.parametrize(
    ("topic", "name", "kind", "harmless"),
    [
        ("imu", "angular_velocity.y", "imu_stuck", 0.05),
        ("imu", "linear_acceleration.z", "imu_stuck", 0.05),
        ("pressure", "fluid_pressure", "barometer_stuck", 0.5),
    ],
)
def test_a_reading_that_stays_the_same_is_no_measurement(
    topic: str, name: str, kind: str, harmless: float
) -> None:
    assert kind in [one.kind for one in repeated(name, topic, 20.0, 22.0) if not one.follows]
    assert repeated(name, topic, 20.0, 20.0 + harmless) == []


def test_poses_that_are_repeated_are_frozen_and_another_bodys_are_not() -> None:
    flight = Flight()
    kept = (flight.poses >= 20.0) & (flight.poses < 20.4)
    flight.tracked[kept] = flight.tracked[kept][0]
    first = explain(flight.topics(), PARAMETERS)[0]
    assert first.kind == "tracker_frozen"
    assert first.start == pytest.approx(20.0)
    assert "positions for 0.39 s" in first.claim
    flight.tracked[kept] = [3.0, 3.0, 0.5]  # another body, which rests
    assert "tracker_frozen" not in [one.kind for one in explain(flight.topics(), PARAMETERS)]


def test_samples_that_are_missing_are_counted() -> None:
    topics = Flight().topics()
    imu = topics["imu"]
    assert isinstance(imu, Columns)
    keep = np.random.default_rng(2).random(len(imu.time)) > 0.05
    kept = {name: values[keep] for name, values in imu._values.items()}
    topics["imu"] = Columns(imu.time[keep], kept)
    first = explain(topics, PARAMETERS)[0]
    assert first.kind == "imu_gaps"
    assert numbers(first.claim)[0] == pytest.approx(5.0, abs=0.5)


@pytest.mark.parametrize(("steady", "how"), [(True, "steadily"), (False, "at once")])
def test_a_barometer_that_leaves_the_height_says_how(steady: bool, how: str) -> None:
    flight = Flight()
    time = flight.time[::20]
    rise = 11.8 * 3.0
    flight.pressure -= rise * ((time - FROM) / 15.0).clip(0.0, 1.0) if steady else 0.0
    flight.pressure -= 0.0 if steady else np.where(time > FROM, rise, 0.0)
    [found] = explain(flight.topics(), PARAMETERS)
    assert (found.kind, how in found.claim) == ("barometer_off", True)
    assert numbers(found.claim)[0] == pytest.approx(3.0, abs=0.3)


def battery(voltage: Array, flight: Flight | None = None) -> list[str]:
    topics = (flight or Flight()).topics()
    time = np.arange(0.0, 40.0, 0.5)
    topics["battery"] = Columns(time, {"voltage": voltage})
    return [one.kind for one in explain(topics, PARAMETERS)]


def test_a_voltage_that_the_motors_do_not_move_is_not_measured() -> None:
    time = np.arange(0.0, 40.0, 0.5)
    flown = np.where((time > 5.0) & (time < 35.0), 15.9, 16.6)
    assert battery(flown) == []
    assert battery(np.where(time > 20.0, 15.9, flown)) == ["battery_stuck"]


def test_a_voltage_that_falls_at_the_same_thrust_is_a_weak_battery() -> None:
    time = np.arange(0.0, 40.0, 0.5)
    drained = 16.2 - 0.02 * time
    assert battery(drained) == []
    assert battery(drained - np.where(time > 20.0, 0.8, 0.0)) == ["battery_sag"]
    loaded = Flight()
    payload(loaded)  # which needs more current
    assert battery(drained - np.where(time > FROM, 0.8, 0.0), loaded) == ["thrust_off"]


def test_bearings_that_are_late_are_named() -> None:
    topics = Flight().topics()
    time = np.arange(0.0, 40.0, 0.02)
    age = np.where(time > 20.0, 0.06, 0.008) + 0.01 * (np.arange(len(time)) % 2)
    topics["estimator"] = Columns(time, {"measurement_age": age})
    topics["status"] = Columns(
        topics["status"].time,
        {"airborne": topics["status"].values("airborne")},
        [(0.0, ""), (12.0, "on_bearings")],
    )
    [found] = explain(topics, PARAMETERS)
    assert found.kind == "tracker_late"
    assert any(abs(one - 60.0) < 2.0 for one in numbers(found.claim)), found.claim


def gyroscope_ramp(flight: Flight) -> None:
    flight.rates[:, 1] += np.radians(0.3) * (flight.time - FROM).clip(0.0)


def test_a_bias_of_the_gyroscope_in_the_last_seconds_of_a_flight_is_named() -> None:
    flight = Flight()
    flight.airborne = (flight.time > 5.0) & (flight.time < 36.0)  # judged until 34 s
    flight.rates[flight.time > 29.0, 1] += np.radians(2.0)
    assert "gyroscope_off" in [one.kind for one in explain(flight.topics(), PARAMETERS)]


def test_a_gyroscope_whose_bias_grows_is_not_taken_for_outliers_of_the_tracker() -> None:
    """The estimate follows the gyroscope, so that the poses are far from it."""
    flight = Flight()
    gyroscope_ramp(flight)
    topics = flight.topics()
    state = topics["state"]
    assert isinstance(state, Columns)
    wrong = np.where((state.time > 24.0) & (state.time % 1.0 < 0.15), 0.3, 0.0)
    state._values[POSITION[0]] = state.values(POSITION[0]) + wrong
    found = explain(topics, PARAMETERS)
    assert found[0].kind == "gyroscope_off", [one.kind for one in found]
    assert "tracker_outliers" not in [one.kind for one in found]


def test_axes_that_turn_are_named_although_the_estimate_follows_at_once() -> None:
    flight = Flight()
    turn = rotation_exp(np.array([0.0, 0.0, np.pi / 2.0]))
    after = flight.poses >= 20.0
    topics = flight.topics()  # the estimate, as if there was no turn
    flight.tracked[after] = flight.tracked[after] @ turn.T
    flight.tracked_R_wb = np.where(
        after[:, None, None], turn @ flight.tracked_R_wb, flight.R_wb[::5]
    )
    turned = flight.topics()
    followed = turned["state"].time >= 20.5
    state = {}
    for name in (*POSITION, *ATTITUDE):
        state[name] = np.where(followed, turned["state"].values(name), topics["state"].values(name))
    turned["state"] = Columns(turned["state"].time, state)
    turned["bearings"] = Columns(np.zeros(0), {})
    first = explain(turned, PARAMETERS)[0]
    assert first.kind == "tracker_moved"
    assert first.start == pytest.approx(20.0, abs=0.3)


def test_what_a_flight_does_not_tell_apart_is_said() -> None:
    first = explained(payload)[0]
    assert first.alike[0].startswith("more mass")
    assert first.text.endswith(
        "motors that are all weaker or sinking air: this flight does not tell."
    )
    assert first.as_json()["alike"] == list(first.alike)
    stuck = repeated("angular_velocity.y", "imu", 20.0, 22.0)[0]
    assert (stuck.alike, stuck.text) == ((), stuck.claim)


def test_poses_that_come_twice_late_or_less_often_are_told_apart() -> None:
    topics = Flight().topics()
    poses = topics["tracker_pose"]
    assert isinstance(poses, Columns)

    def chosen(rows: Array) -> list[str]:
        columns = {name: values[rows] for name, values in poses._values.items()}
        changed = {**topics, "tracker_pose": Columns(poses.time[rows], columns)}
        return [one.kind for one in explain(changed, PARAMETERS)]

    rows = np.arange(len(poses.time))
    after = poses.time[rows] > 20.0
    assert chosen(np.sort(np.concatenate([rows, rows[after]]))) == ["tracker_repeated"]
    assert chosen(rows[~after | (rows % 5 == 0)]) == ["tracker_slow"]


@pytest.mark.parametrize(("used", "kind"), [(0.0, "tracker_clock"), (0.6, "tracker_disordered")])
def test_poses_that_are_ignored_for_their_stamps_are_named(used: float, kind: str) -> None:
    topics = Flight().topics()
    time = np.arange(0.0, 40.0, 0.02)
    wrong = (time > 20.0) & (time < 24.0)
    counts = {
        "measurements_used": np.cumsum(np.where(wrong, 2.0 * used, 2.0)),
        "measurements_ignored": np.cumsum(np.where(wrong, 2.0 - 2.0 * used, 0.0)),
    }
    topics["estimator"] = Columns(time, counts)
    [found] = explain(topics, PARAMETERS)
    assert (found.kind, round(found.start)) == (kind, 20)
