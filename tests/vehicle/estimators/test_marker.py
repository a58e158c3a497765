"""Flight on the position of a single marker and the IMU."""

from __future__ import annotations

import math

import numpy as np
import pytest

from quadrotor.parameter_description import ParameterValue
from quadrotor.records import NO_ATTITUDE, POSE_SAMPLE, Record, has_attitude
from quadrotor.rotations import yaw_of
from tests.support.lab import Lab, flight_parameters, refusal
from tests.support.narrowing import now
from vehicle import mailbox
from vehicle.modes import Flag

FILTER = "estimation.error_state"


class MarkerLab(Lab):
    """Vehicle with a marker whose positions can be displaced or held back."""

    def __init__(self, settings: dict[str, ParameterValue] | None = None) -> None:
        parameters = flight_parameters()
        parameters.seed(7)
        parameters.tracker.positions_only = True
        super().__init__(parameters, {"estimation.estimator": "error_state", **(settings or {})})
        self.moved, self.lost = np.zeros(3), False
        self._take, self.stack.measure = self.stack.measure, self._measure  # type: ignore[method-assign]

    def _measure(self, measurement: mailbox.Measurement | Record) -> None:
        if isinstance(measurement, np.ndarray) and measurement.dtype == POSE_SAMPLE:
            assert not has_attitude(measurement["quaternion_wb"])
            measurement["position_w"] += self.moved
            if self.lost:
                return
        self._take(measurement)

    def heading_error(self) -> float:
        """Return the difference between the estimated and the true heading, rad."""
        told, true = self.stack.state["quaternion_wb"][0], self.robot.truth["quaternion_wb"][0]
        return abs(math.remainder(yaw_of(told) - yaw_of(true), 2.0 * math.pi))

    def heading_deviation(self) -> float:
        return math.sqrt(self.stack.estimate["attitude_variance_w"][0, 2])

    def to_and_fro(self) -> None:
        for x in (1.0, 0.0):
            self.start("fly_to", x=x, y=0.0, z=1.0)
            self.wait_until(lambda v: v.behavior == "hover", what="arrival", timeout=10)

    def forget_heading(self) -> None:
        """Make the heading as uncertain as after minutes of hover."""
        self.stack.estimator.memory["covariance"][0, 5, 5] = math.radians(20.0) ** 2  # type: ignore[attr-defined]


def test_hover_is_held_and_motion_tells_the_heading() -> None:
    """The vehicle is turned 20 deg from the heading that it was given."""
    lab = MarkerLab({f"{FILTER}.heading": 20.0}).hovering()
    errors = []
    for _ in range(100):
        lab.wait(0.05)
        errors.append(lab.robot.truth["position_w"][0] - (0.0, 0.0, 1.0))
    assert np.sqrt(np.mean(np.sum(np.square(errors), axis=1))) < 0.015
    before = lab.heading_deviation()
    lab.to_and_fro()
    assert lab.heading_deviation() < min(before, math.radians(2.0))
    assert lab.heading_error() < math.radians(2.0)
    assert lab.flags == Flag.NONE


def test_a_heading_not_observed_is_told_and_refuses_planned_flight_until_motion_shows_it() -> None:
    lab = MarkerLab().hovering()
    lab.forget_heading()
    lab.wait(0.2)
    assert lab.flags == Flag.HEADING_UNKNOWN
    assert "heading not observed: known to" in lab.said
    why = refusal(lambda: lab.start("follow_trajectory", trajectory="figure_eight"))
    assert "heading not observed" in why
    assert "allowed 15°" in why
    lab.to_and_fro()
    assert now(lab).flags == Flag.NONE
    assert "heading known again" in lab.said
    lab.start("follow_trajectory", trajectory="figure_eight")


def test_arming_takes_the_heading_stated() -> None:
    lab = MarkerLab().ready()
    lab.forget_heading()
    lab.change({f"{FILTER}.heading": 30.0})
    lab.arm()
    lab.wait(0.3)
    assert yaw_of(lab.stack.state["quaternion_wb"][0]) == pytest.approx(
        math.radians(30.0), abs=0.02
    )
    assert lab.heading_deviation() == pytest.approx(math.radians(10.0), abs=0.01)


def test_the_start_is_level_and_the_marker_off_the_imu() -> None:
    lab = MarkerLab({f"{FILTER}.marker_x": 0.05, f"{FILTER}.marker_z": 0.1}).ready()
    expected = lab.robot.truth["position_w"][0] - (0.05, 0.0, 0.1)
    np.testing.assert_allclose(lab.stack.state["position_w"][0], expected, atol=0.01)


def test_a_position_a_metre_off_moves_nothing_and_is_flagged() -> None:
    lab = MarkerLab().hovering()
    lab.moved[0] = 1.0
    lab.wait(0.01)
    lab.moved[0] = 0.0
    lab.wait(0.2)
    assert lab.error() < 0.02
    assert lab.flags == Flag.MEASUREMENTS_REFUSED
    assert lab.stack.estimate["measurements_refused"][0] == 1


def test_a_tracker_that_jumps_for_good_is_followed_with_the_heading_so_far() -> None:
    lab = MarkerLab().hovering()
    lab.to_and_fro()
    lab.moved[0] = 0.3
    lab.wait(2.0)
    assert "was moved" in lab.said
    assert np.linalg.norm(lab.stack.state["position_w"][0] - (0.0, 0.0, 1.0)) < 0.05
    assert lab.heading_error() < math.radians(3.0)


def test_a_gap_is_bridged_and_a_longer_one_ends_the_flight() -> None:
    lab = MarkerLab().hovering()
    lab.lost = True
    lab.wait(0.3)
    assert lab.flags & Flag.NO_POSE
    lab.lost = False
    lab.wait(0.5)
    assert lab.error() < 0.02
    assert not lab.flags & Flag.NO_POSE
    lab.lost = True
    lab.wait(1.1)
    assert lab.view().behavior == "emergency_landing"


def test_late_positions_are_used_at_their_stamps() -> None:
    lab = MarkerLab()
    lab.parameters.tracker.delay = 0.08
    lab.hovering()
    assert lab.error() < 0.03


@pytest.mark.parametrize("position", [(math.nan, 0.0, 0.0), (0.0, math.inf, 0.0)])
def test_a_position_that_is_no_number_is_refused_with_the_reason(
    position: tuple[float, float, float],
) -> None:
    lab = MarkerLab().ready()
    used = int(lab.stack.estimate["measurements_used"][0])
    lab.lost = True
    sample = np.zeros(1, POSE_SAMPLE)
    sample[0] = lab.stack.stamp_ns, position, NO_ATTITUDE
    lab._take(sample)
    assert [text for text in lab.texts() if "cannot be used" in text]
    assert lab.stack.estimate["measurements_used"][0] <= used + 1


def test_the_complementary_filter_refuses_positions_and_names_the_one_that_takes_them() -> None:
    lab = MarkerLab({"estimation.estimator": "complementary"}).ready()
    assert "set estimation.estimator = error_state" in lab.said
    assert "no fresh pose" in refusal(lab.arm)
