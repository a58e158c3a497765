"""Flight on bearings alone: where it may start, its limits, and the return to the tracker.

The decisions of vehicle.estimators.bearings_guard, tested from outside: commands in, mode and
events out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bearing_sim.emulator import BearingParameters
from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, flight_parameters, refusal, shadow_state
from vehicle.estimators.readiness import Lack
from vehicle.modes import Flag
from vehicle.parameters import check_pairs, new_parameters


class BearingsLab(Lab):
    """Vehicle that hovers with the error-state filter on bearings as its shadow."""

    def __init__(self, height: float = 1.0, shadow: bool = True) -> None:
        parameters = flight_parameters()
        parameters.seed(3)
        beside = {"estimation.shadow": "error_state", "estimation.shadow_source": "bearings"}
        super().__init__(parameters, beside if shadow else None)
        self.hovering(height, settling=2.0)

    def hand_over(self) -> BearingsLab:
        self.change(HAND_OVER)
        self.advance()
        return self

    @property
    def source(self) -> str:
        return str(self.parameter("estimation.source"))


def refused_unchanged(lab: BearingsLab, values: dict[str, Any]) -> str:
    store = lab.stack.store
    before, revision, active = store.values(), store.revision, lab.stack.estimator
    reason = refusal(lambda: lab.change(values))
    assert (store.values(), store.revision) == (before, revision)
    assert lab.stack.estimator is active
    return reason


HAND_OVER: dict[str, ParameterValue] = {
    "estimation.source": "bearings",
    "estimation.estimator": "error_state",
}


def test_hand_over_and_back_jump_by_no_more_than_the_estimates_differ() -> None:
    lab = BearingsLab()
    stack = lab.stack
    apart = np.linalg.norm(shadow_state(stack)["position_w"] - stack.state["position_w"])
    before, reference = stack.state["position_w"][0].copy(), stack.reference.copy()
    lab.hand_over()
    assert np.linalg.norm(stack.state["position_w"][0] - before) <= apart + 0.003
    assert np.abs(stack.reference["position_w"] - reference["position_w"]).max() < 0.003
    assert stack.estimator.name == "error_state"  # type: ignore[attr-defined]
    assert stack.store.get("estimation.shadow") == "none"
    lab.advance()
    assert Flag.ON_BEARINGS in lab.flags
    lab.wait(3.0)
    assert 0.001 < lab.error() < 0.06  # without the help of poses
    lab.change({"estimation.source": "poses"})
    assert stack.estimator.name == "complementary"  # type: ignore[attr-defined]
    assert stack.store.get("estimation.shadow") == "error_state"
    assert stack.store.get("estimation.shadow_source") == "bearings"
    lab.advance()
    assert Flag.ON_BEARINGS not in lab.flags
    lab.wait(1.0)
    assert lab.error() < 0.005
    lab.hand_over()  # again, at once: the estimator flown before continued as shadow
    assert lab.source == "bearings"


def test_taking_off_on_bearings_is_refused_with_what_to_do() -> None:
    parameters = flight_parameters()
    parameters.estimation.source = "bearings"
    parameters.estimation.estimator = "error_state"
    reason = refusal(Lab(parameters).ready().arm)
    assert "go back to the tracker" in reason
    assert "above 0.3 m" in reason


def test_low_outside_or_on_a_way_the_hand_over_is_refused_with_numbers() -> None:
    lab = BearingsLab(height=0.25)
    assert "0.25 m above take-off" in refused_unchanged(lab, HAND_OVER)
    lab.start("fly_to", x=1.7, y=0.0, z=1.0)
    lab.wait_until(lambda v: v.position_w[2] > 0.4, what="some height", timeout=5)
    assert "during fly_to" in refused_unchanged(lab, HAND_OVER)
    lab.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
    reason = refused_unchanged(lab, HAND_OVER)
    assert "x = 1.70 m" in reason
    assert "-1.50 to 1.50 m" in reason
    lab.start("fly_to", x=0.0, y=0.0, z=2.3)
    lab.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
    assert "z = 2.30 m" in refused_unchanged(lab, HAND_OVER)


def test_what_does_not_run_or_has_not_converged_is_refused_with_numbers() -> None:
    lab = BearingsLab()
    lab.change({"estimation.shadow_source": "poses"})
    lab.wait(1.0)
    reason = refused_unchanged(lab, HAND_OVER)
    assert "error_state on bearings does not run" in reason
    assert "running: error_state on poses" in reason
    lab.change({"estimation.shadow_source": "bearings"})
    assert "no measurement" in refused_unchanged(lab, HAND_OVER)
    lab.wait(0.15)
    assert "needs 10" in refused_unchanged(lab, HAND_OVER)
    lab.wait(2.0)
    shadow_state(lab.stack)["position_w"][0, 1] += 0.4
    assert "allowed 0.250 m" in refused_unchanged(lab, HAND_OVER)
    lab.advance()
    lab.hand_over()


def test_the_status_tells_how_far_the_shadow_is_from_a_hand_over() -> None:
    lab = BearingsLab()
    lab.change({"estimation.shadow": "none"})
    lab.wait(0.1)
    assert told(lab)["lack"] == Lack.SHADOW
    lab.change({"estimation.shadow": "error_state"})
    lab.advance()
    assert (told(lab)["lack"], told(lab)["ready"]) == (Lack.MEASUREMENTS, 0.0)
    lab.wait(0.25)
    assert told(lab)["lack"] == Lack.CONVERGENCE
    assert 0.0 < told(lab)["share"] < 1.0
    lab.wait(2.0)
    ready = told(lab)
    assert (ready["lack"], ready["share"]) == (Lack.NOTHING, 1.0)
    assert 1.0 < ready["ready"] < 2.2
    assert 0.001 < ready["deviation"] < 0.15
    shadow = shadow_state(lab.stack)["position_w"]
    assert ready["distance"] == pytest.approx(
        np.linalg.norm(shadow - lab.stack.state["position_w"]), abs=0.02
    )
    lab.hand_over()  # and the complementary filter is no shadow then
    lab.wait(0.1)
    assert told(lab)["lack"] == Lack.SHADOW


def told(lab: BearingsLab) -> dict[str, float]:
    names = ("lack", "share", "ready", "deviation", "distance")
    return {name: lab.stack.status[f"shadow_{name}"][0].item() for name in names}


def test_the_walls_close_in_on_bearings_and_open_again() -> None:
    lab = BearingsLab()
    lab.start("velocity")
    lab.hand_over()
    walls = lab.stack.behaviors.parameters
    assert (walls.volume_x_min, walls.volume_y_max) == (-1.5, 1.5)
    assert walls.volume_z_min == pytest.approx(0.3, abs=0.01)
    assert walls.volume_z_max == 2.0
    for _ in range(300):  # full stick forward for 6 s, begun before and after
        lab.sticks((1.0, 0.0, 0.0, 0.0))
        lab.wait(0.02)
    assert 1.2 < lab.stack.reference["position_w"][0, 0] <= 1.5
    assert "outside the flight volume" in refusal(lambda: lab.start("fly_to", x=1.8))
    lab.change({"behavior.volume_x_max": 1.4})  # the user's own limits still apply
    assert lab.stack.behaviors.parameters.volume_x_max == 1.4
    lab.change({"behavior.volume_x_max": 3.0, "estimation.source": "poses"})
    assert lab.stack.behaviors.parameters.volume_x_max == 3.0
    lab.start("fly_to", x=1.8)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"swap": 1.0}, "bearings rejected, allowed 30%"),
        ({"bias_x": 8.0}, ""),
        ({"lost": "all"}, "no frame of bearings applied for 0.5"),
    ],
)
def test_with_the_tracker_there_bad_bearings_end_on_the_tracker(
    fault: dict[str, Any], said: str
) -> None:
    lab = BearingsLab().hand_over()
    lab.wait(2.0)
    assert lab.source == "bearings"
    for name, value in fault.items():
        setattr(lab.parameters.bearings, name, value)
    lab.wait_until(lambda v: lab.source == "poses", what="falling back", timeout=10)
    texts = [text for text in lab.texts() if text.startswith("fell back to the tracker: ")]
    assert len(texts) == 1
    assert said in texts[0]
    assert any(character.isdigit() for character in texts[0])
    lab.advance()
    assert Flag.FELL_BACK in lab.flags
    change = next(c for c in reversed(lab.kept.changes) if c.name == "estimation.source")
    assert (change.new, change.requester) == ("poses", "vehicle")
    lab.wait(1.0)
    assert lab.error() < 0.01
    for name in fault:  # correct again: but it stays on the tracker until a command
        setattr(lab.parameters.bearings, name, getattr(BearingParameters(), name))
    lab.wait(5.0)
    assert lab.source == "poses"
    assert lab.view().armed
    lab.hand_over()
    lab.advance()
    assert Flag.FELL_BACK not in lab.flags


def test_without_the_tracker_bad_bearings_land_the_vehicle_inside() -> None:
    lab = BearingsLab().hand_over()
    lab.parameters.tracker.drop_out = 1.0
    lab.wait(2.0)
    assert lab.source == "bearings"
    assert lab.view().mode == "armed"
    lab.parameters.bearings.swap = 1.0
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=5)
    assert any("no tracker to fall back to" in text for text in lab.texts())
    lab.wait_until(lambda v: not v.armed, what="touch-down", timeout=15)
    assert np.abs(lab.robot.truth["position_w"][0, :2]).max() < 1.5


def test_without_tracker_and_bearings_the_vehicle_lands_on_its_imu() -> None:
    lab = BearingsLab().hand_over()
    lab.parameters.tracker.drop_out = 1.0
    lab.parameters.bearings.lost = "all"
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=5)
    lab.wait_until(lambda v: not v.armed, what="touch-down", timeout=15)
    assert any("no pose measurement for" in text for text in lab.texts())


def test_land_goes_back_to_the_tracker_first_and_without_it_down_on_bearings() -> None:
    lab = BearingsLab().hand_over()
    lab.start("land")
    lab.wait(0.1)
    assert lab.source == "poses"
    lab.start("hover")
    lab.wait(2.0)
    lab.hand_over()
    lab.parameters.tracker.drop_out = 1.0
    lab.wait(0.5)
    assert "has not converged" in refusal(lambda: lab.change({"estimation.source": "poses"}))
    lab.start("land")
    lab.wait_until(lambda v: not v.armed, what="touch-down", timeout=15)
    assert lab.source == "bearings"
    assert np.abs(lab.robot.truth["position_w"][0, :2]).max() < 0.2


def test_the_tracker_that_returns_during_a_landing_takes_over() -> None:
    lab = BearingsLab().hand_over()
    lab.parameters.tracker.drop_out = 1.0
    lab.wait(0.5)
    lab.start("land")
    lab.wait(0.5)
    assert lab.source == "bearings"
    lab.parameters.tracker.drop_out = 0.0
    lab.wait_until(lambda v: lab.source == "poses", what="the tracker", timeout=2)
    assert lab.view().airborne


def test_the_layout_is_checked_and_stays_while_bearings_are_flown_on() -> None:
    lab = BearingsLab()
    moved = "1 1.2 1.0 0.1; 2 -1.0 1.0 0.1; 3 -1.0 -1.0 0.1; 4 1.0 -1.0 0.1"
    store = lab.stack.store
    before, revision = store.values(), store.revision
    with pytest.raises(RefusedError, match=r"beacons\.layout: "):
        lab.change({"beacons.layout": "1 0 0 0; 2 1 0 0"})
    assert (store.values(), store.revision) == (before, revision)
    lab.change({"beacons.layout": moved})
    lab.parameters.bearings.layout = moved
    shadow = lab.stack.navigation.shadow
    assert shadow is not None
    assert not shadow.converged  # started again
    lab.wait(2.0)
    lab.hand_over()
    lab.wait(2.0)
    assert lab.error() < 0.06  # the positions were taken over
    assert "go back to the tracker first" in refused_unchanged(lab, {"beacons.layout": "paper"})
    lab.change({"estimation.source": "poses"})
    lab.change({"beacons.layout": "paper"})


def test_a_layout_that_is_none_is_refused_at_the_start_too() -> None:
    values: dict[str, Any] = ParameterStore(new_parameters()).values() | {
        "beacons.layout": "papper"
    }
    with pytest.raises(OutOfBoundsError, match="did you mean paper"):
        check_pairs(values)


def test_no_bearings_are_watched_before_a_hand_over() -> None:
    lab = BearingsLab()
    lab.parameters.bearings.swap = 1.0
    lab.wait(3.0)
    assert lab.stack.navigation.watch.verdict is None
    assert lab.error() < 0.005
