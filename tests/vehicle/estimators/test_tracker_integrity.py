"""A tracker whose poses contradict the inertial sensors is noticed."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.flights.watched_flight import WatchedFlight
from quadrotor.constants import GRAVITY
from quadrotor.errors import RefusedError
from quadrotor.plain_rotations import matrix_of, turned
from quadrotor.records import (
    ACTUATORS,
    IMU_SAMPLE,
    NO_ATTITUDE,
    POSE_SAMPLE,
    Array,
    new_state,
    pose_sample,
)
from quadrotor.vehicle_model import VehicleModel
from tests.support.lab import Lab, flight_parameters
from vehicle.estimators.tracker_integrity import TrackerIntegrity
from vehicle.modes import Flag
from vehicle.safety.parameters import SafetyParameters

Lie = Callable[[Array, Array], tuple[Array, Array]]
"""Function from the true position and attitude to those that the tracker sends."""
PERIOD_NS, POSE_EVERY = 2_000_000, 5
START_NS = 1_000_000_000


def truth(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    return position_w, quaternion_wb


def left_handed(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose in a frame whose y axis points to the right."""
    return position_w * (1, -1, 1), quaternion_wb * (1, -1, 1, -1)


def upside_down(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose in a frame whose z axis points down."""
    return position_w * (1, 1, -1), quaternion_wb * (1, -1, -1, 1)


def inverse(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with the rotation from world to body."""
    return position_w, quaternion_wb * (1, -1, -1, -1)


def quarter_turn(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose of a body whose x axis points to the left."""
    return position_w, turned(quaternion_wb, (0.0, 0.0, 0.5 * math.pi))


def mirrored(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with a wrong sign of y alone."""
    return position_w * (1, -1, 1), quaternion_wb


def exchanged(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with x and y of the position exchanged."""
    return position_w[[1, 0, 2]], quaternion_wb


def turned_body(degrees: float) -> Lie:
    """Return a lie about the heading of the body's axes."""
    turn = 0.0, 0.0, math.radians(degrees)
    return lambda position_w, quaternion_wb: (position_w, turned(quaternion_wb, turn))


def tilted(degrees: float) -> Lie:
    """Return a lie about the vertical."""
    turn = math.radians(degrees), 0.0, 0.0
    return lambda position_w, quaternion_wb: (position_w, turned(quaternion_wb, turn))


def enlarged(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with positions that are 6 % too large."""
    return 1.06 * position_w, quaternion_wb


def enlarged_a_little(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose with positions that are 5 % too large."""
    return 1.05 * position_w, quaternion_wb


def on_its_back(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose of a body whose markers were taken for those of one upside down."""
    return position_w, turned(quaternion_wb, (math.pi, 0.0, 0.0))


class Moved:
    """A vehicle that moves and turns on sines, its IMU and its tracker, both with seeded noise."""

    def __init__(self, motion: float = 1.0, **parameters: Any) -> None:
        self.lines: list[str] = []
        self.judge = TrackerIntegrity(
            SafetyParameters(**parameters), lambda line, _: self.lines.append(line)
        )
        self.lie: Lie = truth
        self.motion, self.late_ns, self.outliers = motion, 0, 0.0
        self.armed = True
        self.time = 0.0
        self._chance = np.random.default_rng(1)
        self._quaternion = np.array([1.0, 0.0, 0.0, 0.0])
        self._past: list[tuple[Array, Array]] = []
        self._state = new_state()
        self._actuators, self._model = np.zeros(1, ACTUATORS), VehicleModel().record()

    def run(self, seconds: float, lie: Lie | None = None) -> list[bool]:
        """Advance; return which of the poses were taken."""
        self.lie = lie or self.lie
        taken = []
        for _ in range(round(seconds * 1e9 / PERIOD_NS)):
            self._sense()
            if round(self.time * 1e9 / PERIOD_NS) % POSE_EVERY == 0:
                taken.append(self._track())
        return taken

    def fly(self) -> None:
        """Let the motors carry it."""
        self._actuators["wrench"][0, 0] = VehicleModel().mass * GRAVITY

    @property
    def told(self) -> str:
        return " | ".join(self.lines)

    def _sense(self) -> None:
        dt = 1e-9 * PERIOD_NS
        self.time += dt
        a, middle = self.motion, self.time - 0.5 * dt
        rate = a * np.array([0.5, 0.6, 0.4]) * np.cos(np.array([3.0, 2.5, 1.0]) * middle)
        self._quaternion = turned(self._quaternion, (dt * rate).tolist())
        self._state["quaternion_wb"][0] = self._quaternion
        w = np.array([2.0, 3.0, 2.5])
        swing = a * np.array([0.3, 0.15, 0.1])
        self._position = swing * np.sin(w * self.time) + (0.0, 0.0, 1.0)
        self._state["velocity_w"][0] = swing * w * np.cos(w * self.time)
        felt = matrix_of(self._quaternion).T @ (
            -swing * w * w * np.sin(w * middle) + (0.0, 0.0, GRAVITY)
        )
        imu, noise = np.zeros(1, IMU_SAMPLE), self._chance.standard_normal(6)
        imu["stamp_ns"] = START_NS + round(self.time * 1e9)
        imu["specific_force_b"][0] = felt + 0.05 * noise[:3] + (0.03, -0.02, 0.04)
        imu["angular_velocity_b"][0] = rate + math.radians(0.3) * noise[3:]
        self.judge.note(imu, self._actuators, self._model, 1e5)

    def _track(self) -> bool:
        self._past.append((self._position, self._quaternion))
        place, turn = self._past[-1 - min(self.late_ns // 10_000_000, len(self._past) - 1)]
        place, turn = self.lie(place, turn)
        noise = self._chance.standard_normal(6)
        if self._chance.random() < self.outliers:
            place = place + 0.3 * noise[:3]
        place = place + 0.001 * noise[:3]
        turn = turned(turn, (math.radians(0.2) * noise[3:]).tolist())
        stamp_ns = START_NS + round(self.time * 1e9)
        return self.judge.takes(pose_sample(stamp_ns, place, turn), self._state, self.armed)


def test_true_poses_are_taken() -> None:
    moved = Moved()
    assert all(moved.run(20.0))
    assert moved.lines == []
    assert moved.judge.flags == 0


TURNS, MOVES = "attitude contradicts the gyroscope", "position contradicts the accelerometer"


@pytest.mark.parametrize(
    ("lie", "witness"),
    [
        (left_handed, TURNS),
        (inverse, TURNS),
        (quarter_turn, TURNS),
        (upside_down, TURNS),
        (mirrored, MOVES),
        (exchanged, MOVES),
    ],
)
def test_reversed_and_permuted_axes_are_found(lie: Lie, witness: str) -> None:
    moved = Moved()
    taken = moved.run(4.0, lie)
    assert witness in moved.told
    assert "check that its frame is right-handed" in moved.told
    assert not any(taken[300:])  # within 3 s, in whose first half the filters settle
    assert moved.judge.flags & Flag.TRACKER_CONTRADICTED


@pytest.mark.parametrize(("lie", "seen"), [(mirrored, False), (left_handed, True)])
def test_in_a_hand_only_the_attitude_is_compared(lie: Lie, seen: bool) -> None:
    moved = Moved()
    moved.armed = False
    taken = moved.run(4.0, lie)
    assert bool(moved.judge.contradiction) is seen
    assert not any(taken[300:]) if seen else all(taken)


def test_at_rest_nothing_can_show() -> None:
    moved = Moved(motion=0.0)
    assert all(moved.run(10.0, left_handed))
    assert moved.lines == []


@pytest.mark.parametrize("rate", [100, 250, 500])
def test_a_vehicle_at_rest_is_taken_for_no_lie_at_any_rate_of_samples(rate: int) -> None:
    parameters = flight_parameters()
    parameters.simulator.imu_rate = rate
    lab = Lab(parameters).ready()
    lab.wait(20.0)
    assert "contradicts" not in lab.said
    assert not lab.flags & Flag.TRACKER_CONTRADICTED


def test_poses_that_are_true_again_are_used_again() -> None:
    moved = Moved()
    moved.run(4.0)
    moved.run(3.0, left_handed)
    taken = moved.run(3.0, truth)
    assert "the tracker agrees with the inertial sensors again" in moved.lines
    assert all(taken[105:])


def test_poses_that_are_true_at_last_are_used() -> None:
    moved = Moved()
    moved.run(10.0, left_handed)
    assert all(moved.run(15.0, truth)[1200:])
    assert "the tracker agrees with the inertial sensors again" in moved.lines
    assert moved.judge.flags == 0


def test_a_lie_is_not_forgotten_at_rest_but_after_a_pause_of_the_tracker() -> None:
    moved = Moved()
    moved.run(4.0, left_handed)
    moved.motion = 0.0
    assert not any(moved.run(10.0))
    for _ in range(1100):
        moved._sense()
    assert moved._track()


@pytest.mark.parametrize("lie", [turned_body(20.0), tilted(1.0)])
def test_small_errors_are_no_lie(lie: Lie) -> None:
    moved = Moved()
    assert all(moved.run(15.0, lie))
    assert "contradicts" not in moved.told


@pytest.mark.parametrize("lie", [on_its_back, turned_body(180.0)])
def test_an_attitude_that_jumps_in_flight_is_a_lie_until_it_is_right_again(lie: Lie) -> None:
    moved = Moved(motion=0.2)  # nearly level: a heading that jumps does not move the vertical
    moved.fly()
    moved.run(4.0)
    assert not any(moved.run(1.0, lie)[2:])
    assert "the tracker's attitude jumped" in moved.told
    assert all(moved.run(1.0, truth)[2:])
    assert moved.lines[-1] == "the tracker agrees with the inertial sensors again"


def turned_frame(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
    """Return the pose in a frame that is turned by 180° about a place 0.5 m from the vehicle's."""
    half = np.array([0.0, 0.0, 0.0, 1.0])
    w, x, y, z = quaternion_wb
    return (
        position_w * (-1, -1, 1) + (1.0, 0.0, 0.0),
        half * w + np.array([0.0, -y, x, 0.0]) - (z, 0.0, 0.0, 0.0),
    )


@pytest.mark.parametrize("lie", [turned_body(20.0), turned_frame])
def test_a_heading_that_jumps_is_followed_if_it_is_small_or_that_of_the_frame(lie: Lie) -> None:
    moved = Moved()
    moved.fly()
    moved.run(4.0)
    assert moved.run(1.0, lie)[-1]
    assert "jumped" not in moved.told


def test_attitudes_that_are_single_outliers_are_no_jump_of_the_vertical() -> None:
    moved = Moved()
    moved.fly()
    moved.run(4.0)
    chance = np.random.default_rng(2)

    def at_times(position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
        off = chance.normal(0.0, 0.5, 3) if chance.random() < 0.3 else np.zeros(3)
        return position_w, turned(quaternion_wb, off.tolist())

    moved.run(10.0, at_times)
    assert "contradicts" not in moved.told
    assert "jumped" not in moved.told


def test_outliers_are_no_evidence() -> None:
    moved = Moved()
    moved.outliers = 0.3
    assert all(moved.run(15.0))
    assert moved.lines == []


def test_the_check_can_be_switched_off() -> None:
    moved = Moved(tracker_check=False)
    assert all(moved.run(4.0, left_handed))
    assert "contradicts" not in moved.told


def test_a_marker_has_no_attitude_to_compare_by() -> None:
    moved = Moved()
    for k in range(500):
        moved._sense()
        sample = pose_sample(START_NS + k * PERIOD_NS, moved._position * (1, -1, 1), NO_ATTITUDE)
        assert moved.judge.takes(sample, new_state(), True)


@pytest.mark.parametrize("motion", [0.0, 1.0])
def test_a_vertical_that_is_off_by_2_degrees_is_told_within_5_s(motion: float) -> None:
    moved = Moved(motion)
    moved.run(5.0)
    assert all(moved.run(5.0, tilted(2.0))[20:])  # the first ones jump
    assert "vertical of the tracker is" in moved.told
    assert moved.judge.flags == Flag.TRACKER_TILTED
    moved.run(8.0, truth)
    assert moved.judge.flags == 0


def test_a_vertical_that_drifts_by_0_2_degrees_per_second_is_told() -> None:
    moved = Moved(0.2)
    moved.run(5.0)
    for k in range(100):
        moved.run(0.1, tilted(0.02 * k))
    assert "vertical of the tracker is" in moved.told
    assert "contradicts" not in moved.told


def test_stamps_that_are_40_ms_late_are_told() -> None:
    moved = Moved()
    moved.run(5.0)
    moved.late_ns = 40_000_000
    assert all(moved.run(20.0)[20:])
    assert "stamps are" in moved.told
    assert "ms too late by the gyroscope" in moved.told


def test_positions_that_are_6_percent_too_large_are_told() -> None:
    moved = Moved()
    assert all(moved.run(15.0, enlarged))
    assert "positions are" in moved.told
    assert "% too large by the accelerometer" in moved.told


def test_positions_that_become_5_percent_too_large_are_told_within_8_s_until_they_are_not() -> None:
    moved = Moved(0.8)
    moved.run(20.0)
    assert "positions are" not in moved.told
    moved.run(8.0, enlarged_a_little)
    assert "% too large by the accelerometer" in moved.told
    moved.run(20.0, truth)
    assert "the tracker's scale: no error any more" in moved.told


def test_poses_that_scatter_in_a_hover_show_no_scale() -> None:
    moved, chance = Moved(0.0), np.random.default_rng(7)
    moved.run(60.0, lambda place, turn: (place + 0.004 * chance.standard_normal(3), turn))
    assert "positions are" not in moved.told


# ---------------------------------------------------------------------- whole flights


def lying(flight: WatchedFlight, lie: Lie) -> WatchedFlight:
    """Let the tracker of a flight lie from now on."""
    stack: Any = flight.stack
    measure = type(flight.stack).measure.__get__(stack)

    def wrong(message: Any) -> None:
        if isinstance(message, np.ndarray) and message.dtype == POSE_SAMPLE:
            message = message.copy()
            place, turn = lie(message["position_w"][0], message["quaternion_wb"][0])
            message["position_w"][0], message["quaternion_wb"][0] = place, turn
        measure(message)

    stack.measure = wrong
    return flight


def ready(lie: Lie) -> WatchedFlight:
    flight = lying(WatchedFlight(1), lie)
    flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
    flight.wait(2.0)
    return flight


def test_a_tracker_whose_z_axis_points_down_stops_the_motors_on_the_ground() -> None:
    flight = ready(upside_down)
    flight.arm()
    flight.wait(0.5)
    flight.start("take_off")
    flight.wait(2.0)
    assert flight.view().mode == "ready"
    assert any(MOVES in text for text in flight.events.texts)
    assert flight.trace()[1][:, 2].max() < 0.1
    with pytest.raises(RefusedError, match=MOVES):
        flight.arm()


@pytest.mark.parametrize("lie", [left_handed, inverse, quarter_turn])
def test_no_lie_from_the_start_turns_the_vehicle_over(lie: Lie) -> None:
    flight = ready(lie)
    flight.arm()
    flight.wait(0.5)
    flight.start("take_off")
    flight.wait(2.0)
    assert flight.down()
    assert flight.trace()[1][:, 2].max() < 0.1
    assert flight.most_tilted < math.radians(10.0)
    assert flight.hardest < 1.0  # it falls from there
    assert any(TURNS in text for text in flight.events.texts)


def test_a_vehicle_that_is_shown_upside_down_in_flight_lands() -> None:
    flight = lying(WatchedFlight(3).hover(settling=1.0), on_its_back)
    flight.forget()
    assert flight.down()
    assert any("attitude jumped" in text for text in flight.events.texts)
    assert flight.hardest < 0.5
    assert flight.most_tilted < math.radians(5.0)


def test_a_flight_goes_on_when_the_tracker_is_right_again_in_time() -> None:
    flight = WatchedFlight(3).hover(1.0)
    flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
    flight.wait(5.0)
    y = flight.robot.truth["position_w"][0, 1:2]
    flight.wait_until(lambda v: bool(abs(y[0]) < 0.02), what="the mirror's plane", timeout=4)
    lying(flight, mirrored)
    flight.wait_until(lambda v: bool(flight.stack.integrity.contradiction), what="alarm", timeout=3)
    lying(flight, truth)
    flight.wait(4.0)
    assert flight.view().behavior == "follow_trajectory"
    assert "the tracker agrees with the inertial sensors again" in flight.events.texts


def test_a_vehicle_is_not_armed_on_a_tilted_tracker() -> None:
    flight = ready(tilted(8.0))
    with pytest.raises(RefusedError, match=r"vertical of the tracker is [78]\.\d° off"):
        flight.arm()


def with_fault(text: str) -> WatchedFlight:
    """Return a flight that hovered at 1 m, 8 s after this fault of the simulator began."""
    flight = WatchedFlight(2).hover(settling=3.0)
    flight.forget()
    flight.change({"simulator.faults": f"{text} for=3"})
    flight.run(8.0)
    return flight


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("imu.misalignment", "the accelerometer contradicts the tracker and the motors"),
        ("imu.scale", "the accelerometer contradicts the tracker and the motors"),
        ("imu.stuck axis=x", "an axis of the gyroscope is stuck, or beyond its range"),
        ("imu.stuck axis=y", "an axis of the gyroscope is stuck, or beyond its range"),
    ],
)
def test_a_wrong_imu_lands_the_vehicle_softly_on_the_tracker(fault: str, why: str) -> None:
    flight = with_fault(fault)
    assert f"emergency land: {why}" in flight.events.texts
    assert flight.down()
    until = flight.events.texts.index("touched down")
    assert not any("poses count as missing" in text for text in flight.events.texts[:until])
    places = flight.trace()[1]
    assert np.hypot(places[:, 0], places[:, 1]).max() < 0.25
    assert flight.hardest < 0.4
    assert flight.most_tilted < math.radians(4.0)


@pytest.mark.parametrize("ramp", ["", " x=-0.55 y=0 z=-0.55"])
def test_a_gyroscope_whose_bias_grows_is_flown_on(ramp: str) -> None:
    flight = with_fault(f"imu.gyroscope_ramp{ramp}")
    assert flight.view().behavior == "hover"
    assert not any("contradicts" in text for text in flight.events.texts)


def test_a_lie_about_the_positions_is_not_laid_on_the_accelerometer() -> None:
    flight = WatchedFlight(3).hover(1.0)
    flight.start("follow_trajectory", trajectory="figure_eight", laps=3)
    flight.wait(5.0)
    y = flight.robot.truth["position_w"][0, 1:2]
    flight.wait_until(lambda v: bool(abs(y[0]) < 0.02), what="the mirror's plane", timeout=4)
    lying(flight, mirrored)
    flight.wait(1.0)
    assert flight.stack.integrity.contradiction
    assert not flight.stack.integrity.suspicion
