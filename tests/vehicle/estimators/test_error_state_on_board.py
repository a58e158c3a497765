"""Error-state filter in the whole stack: starts, a tracker that jumps, and their reports."""

from __future__ import annotations

import numpy as np
import pytest

from bearing_sim.beacons import parse_layout
from control.behaviors.table import BehaviorName
from estimation.outcome import LATEST_NS, Agreement
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import POSE_SAMPLE, Record
from tests.support.lab import Lab, flight_parameters
from vehicle import mailbox
from vehicle.modes import Flag

HOUSE = "1 1 1 0.1; 2 -1 1 0.6; 3 -1 -1 0.1; 4 1 -1 1.1; 5 0 1.4 1.5"
"""Beacons at five heights."""


class MovedLab(Lab):
    """Vehicle whose tracker can be moved and whose bearings can be held back.

    Settings are those of `estimation`.
    """

    def __init__(self, layout: str = "paper", lost: str = "", **settings: ParameterValue) -> None:
        parameters = flight_parameters()
        parameters.seed(5)
        parameters.bearings.layout = parameters.beacons.layout = layout
        parameters.bearings.lost = lost
        super().__init__(parameters)
        self.moved, self.older_ns = np.zeros(3), 0
        self._take, self.stack.measure = self.stack.measure, self._measure  # type: ignore[method-assign]
        self.change({f"estimation.{name}": value for name, value in settings.items()})

    def _measure(self, measurement: mailbox.Measurement | Record) -> None:
        if isinstance(measurement, np.ndarray):
            if measurement.dtype == POSE_SAMPLE:
                measurement["position_w"] += self.moved
            else:
                measurement["stamp_ns"] -= self.older_ns
        self._take(measurement)

    def events_with(self, *words: str) -> list[str]:
        """Return the events that contain all these words."""
        return [text for text in self.texts() if all(word in text for word in words)]


# ---------------------------------------------------------------------- starts
@pytest.mark.parametrize(("layout", "lost"), [("paper", "4"), (HOUSE, "")])
def test_beside_a_known_pose_it_starts_on_bearings_that_give_none(layout: str, lost: str) -> None:
    """Three beacons, or beacons in no common plane, give no pose; then it is flown on."""
    lab = MovedLab(
        layout=layout, lost=lost, shadow="error_state", shadow_source="bearings"
    ).hovering()
    [started] = lab.events_with("error_state on bearings started at the pose of")
    assert "complementary on poses" in started
    lab.change({"estimation.estimator": "error_state", "estimation.source": "bearings"})
    lab.wait(4.0)
    assert lab.stack.store.get("estimation.source") == "bearings"
    assert lab.error() < 0.15


def test_without_a_known_pose_three_beacons_are_refused_with_the_reason() -> None:
    lab = MovedLab(lost="4", estimator="error_state", source="bearings").ready()
    lab.wait(1.0)
    assert not lab.stack.estimator.initialized
    assert lab.events_with("error_state cannot start on 3 bearings", "up to four poses")


def test_beacons_in_no_plane_are_refused_by_the_estimators_that_need_one() -> None:
    lab = MovedLab(layout=HOUSE, shadow="complementary", shadow_source="bearings").ready()
    lab.wait(1.0)
    assert lab.events_with("complementary", "leave their common plane")
    assert not lab.events_with("started at the pose of")
    shadow = lab.stack.navigation.shadow
    assert shadow is not None
    assert not shadow.initialized
    assert len(parse_layout(HOUSE)) == 5


# ---------------------------------------------------------------------- the tracker jumps
def test_a_small_jump_of_the_tracker_is_an_event_and_a_flag() -> None:
    lab = MovedLab(estimator="error_state").hovering()
    lab.moved = np.array([0.3, 0.0, 0.0])
    lab.wait(0.4)
    assert lab.stack.estimate["agreement"][0] == Agreement.JUMPED
    assert not lab.stack.estimator.converged
    assert Flag.TRACKER_JUMPED in Flag(int(lab.stack.status["flags"][0]))
    assert lab.events_with("the tracker jumped", "0.30 m")
    assert not lab.events_with("was moved")
    lab.wait(2.0)
    assert len(lab.events_with("the estimate was moved by 0.3")) == 1
    assert lab.stack.estimate["agreement"][0] == Agreement.USED
    assert lab.stack.estimator.converged


def test_a_shadow_that_starts_anew_says_so() -> None:
    lab = MovedLab(shadow="error_state").hovering()
    lab.moved = np.array([0.3, 0.0, 0.0])
    lab.wait(2.0)
    assert len(lab.events_with("error_state restarted, 0.3")) == 1


def test_the_supervisor_sees_a_large_jump_before_the_filter_follows_it() -> None:
    lab = MovedLab(estimator="error_state").hovering()
    lab.moved = np.array([1.0, 0.0, 0.0])
    lab.wait(0.45)
    assert lab.events_with("from their prediction for 0.3 s")
    assert lab.stack.behaviors.name is BehaviorName.EMERGENCY_LANDING
    assert not lab.events_with("was moved")


# ---------------------------------------------------------------------- what is not used
def test_bearings_too_late_to_be_used_are_told_and_counted() -> None:
    lab = MovedLab(estimator="error_state", source="both").hovering()
    lab.older_ns = 310_000_000
    ignored = int(lab.stack.estimate["measurements_ignored"][0])
    lab.wait(2.0)
    assert lab.stack.estimate["measurements_ignored"][0] == ignored
    lab.older_ns = LATEST_NS + 50_000_000
    lab.wait(2.0)
    assert lab.stack.estimate["measurements_ignored"][0] >= ignored + 55
    assert (
        len(lab.events_with("error_state on both did not use", "older than it can go back to")) == 1
    )
    assert lab.error() < 0.02
