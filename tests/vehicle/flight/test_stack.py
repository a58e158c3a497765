"""The whole tick, flown by the simulated vehicle in simulated time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from quadrotor.errors import UnknownParameterError
from tests.support.lab import Lab, refusal
from vehicle import mailbox
from vehicle.modes import Flag, Mode


class StationLab(Lab):
    """Flight whose station and tracker can be silenced."""

    station_alive = True

    def _station(self, now_ns: int) -> None:
        if self.station_alive:
            super()._station(now_ns)


def test_it_takes_off_hovers_and_lands_where_it_should() -> None:
    lab = StationLab().hovering(1.2)
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.2], abs=0.02)
    lab.start("land")
    lab.wait_until(lambda v: not v.armed, what="disarmed", timeout=15)
    lab.wait(1.0)
    assert lab.robot.truth["position_w"][0, 2] == pytest.approx(0.0, abs=0.02)
    assert np.all(lab.robot.rotor_speeds < 20.0), "motors still turn after landing"
    assert "touched down" in lab.said


def test_take_off_is_refused_when_disarmed_and_when_flying() -> None:
    lab = StationLab().ready()
    assert "arm the vehicle first" in refusal(lambda: lab.start("take_off"))
    lab = StationLab().hovering()
    assert "flying already" in refusal(lambda: lab.start("take_off"))


def test_fly_to_outside_the_flight_volume_is_refused_and_changes_nothing() -> None:
    lab = StationLab().hovering()
    reason = refusal(lambda: lab.start("fly_to", x=50.0))
    assert "50" in reason
    assert lab.view().behavior == "hover"
    lab.wait(1.0)
    assert lab.robot.truth["position_w"][0] == pytest.approx([0, 0, 1], abs=0.02)


def test_an_unknown_behavior_and_an_unknown_argument_are_refused_by_name() -> None:
    lab = StationLab().hovering()
    assert "land" in refusal(lambda: lab.start("lnad"))
    with pytest.raises(UnknownParameterError, match="heigth"):
        lab.stack.behaviors.request(
            "fly_to", {"heigth": 1.0}, lab.stack.state, armed=True, airborne=True
        )
    assert "heigth" in refusal(lambda: lab.start("fly_to", heigth=1.0))
    assert lab.view().behavior == "hover"


def test_arming_is_refused_before_the_gyroscope_is_calibrated_and_without_a_pose() -> None:
    lab = StationLab()
    lab.advance()
    assert "gyroscope" in refusal(lab.arm)
    lab.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
    lab.station_alive = False
    lab.wait(0.3)
    assert "pose" in refusal(lab.arm)


def test_arming_is_refused_when_only_the_heartbeat_is_missing() -> None:
    lab = StationLab().ready()
    lab._next_heartbeat_ns = 10**15
    lab.wait(1.0)
    assert "no heartbeat from the station" in refusal(lab.arm)


def test_disarming_in_flight_is_refused_and_the_cut_stops_the_motors() -> None:
    lab = StationLab().hovering()
    disarm = mailbox.Disarm("1", "test")
    assert "flying" in lab.stack.handle(disarm).reason
    assert lab.stack.handle(mailbox.Emergency("2", "test", "cut")).accepted
    lab.wait(0.3)
    assert lab.stack.mode is Mode.CUT
    assert lab.robot.truth["velocity_w"][0, 2] < -1.0, "the vehicle should be falling"
    assert "disarm first" in refusal(lab.arm)
    assert lab.stack.handle(mailbox.Disarm("3", "test")).accepted


def test_an_emergency_landing_refuses_everything_but_the_cut() -> None:
    lab = StationLab().hovering()
    assert lab.stack.handle(mailbox.Emergency("1", "test", "land")).accepted
    assert "emergency landing" in refusal(lambda: lab.start("hover"))
    lab.wait_until(lambda v: v.mode == "ready", what="on the ground", timeout=15)
    assert lab.robot.truth["position_w"][0, 2] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("action", ["lnad", "", "CUT"])
def test_an_unknown_emergency_action_names_the_two_there_are(action: str) -> None:
    reply = StationLab().hovering().stack.handle(mailbox.Emergency("1", "test", action))
    assert not reply.accepted
    assert "land or cut" in reply.reason


def test_a_lost_station_makes_it_brake_and_land_on_its_inertial_sensors() -> None:
    lab = StationLab(settings={"safety.link_land_after": 1.0}).hovering()
    silent = lab.stack.stamp_ns
    lab.station_alive = False
    lab.wait_until(
        lambda v: v.behavior in ("brake", "hover") and "braking" in lab.said,
        what="braking",
        timeout=0.5,
    )
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=1.2)
    lab.wait_until(lambda v: not v.armed, what="disarmed", timeout=15)
    flown = (lab.stack.stamp_ns - silent) * 1e-9
    truth = lab.robot.truth["position_w"][0]
    assert truth[2] == pytest.approx(0.0, abs=0.02), f"not on the ground after {flown:.1f} s"
    assert np.hypot(*truth[:2]) < 1.5, "drifted more than a dead-reckoned landing should"


def test_a_lost_pose_alone_lands_it() -> None:
    lab = StationLab(settings={"safety.pose_land_after": 0.5}).hovering()
    lab._tracker.parameters.drop_out = 1.0
    lab.wait_until(lambda v: v.mode == "emergency_land", what="landing", timeout=1.0)
    assert int(lab.stack.status["flags"][0]) & Flag.NO_POSE
    assert "no pose measurement" in lab.said


def test_a_parameter_change_is_applied_whole_and_told_with_who_old_and_new() -> None:
    lab = StationLab().ready()
    name = "control.position.kp_xy"
    old = lab.stack.store.get(name)
    reply = lab.stack.handle(mailbox.ChangeParameters("1", "alice", {name: 5.0}))
    assert (reply.accepted, reply.applied) == (True, {name: 5.0})
    assert reply.revision == lab.stack.status["parameter_revision"][0]
    lab.advance()
    change = lab.kept.changes[-1]
    assert (change.requester, change.old, change.new) == ("alice", old, 5.0)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"control.position.kp_xy": float("nan")}, "finite"),
        ({"control.position.kp_xy": 1e6}, "out of bounds"),
        ({"control.position.kp_xy": "stiff"}, "a number"),
        ({"control.position.kp_xz": 4.0}, "control.position.kp_xy"),
        ({"control.position.kp_xy": 5.0, "control.position.kp_z": -1.0}, "out of bounds"),
    ],
)
def test_a_bad_parameter_change_changes_nothing(values: dict[str, Any], said: str) -> None:
    lab = StationLab().ready()
    before, revision = lab.stack.store.values(), lab.stack.store.revision
    reply = lab.stack.handle(mailbox.ChangeParameters("1", "test", values))
    assert not reply.accepted
    assert said in reply.reason
    assert lab.stack.store.values() == before
    assert lab.stack.store.revision == revision


def test_the_tick_is_a_function_of_its_inputs() -> None:
    def fly() -> bytes:
        lab = StationLab().hovering()
        return lab.stack.record.tobytes() + lab.robot.truth.tobytes()

    assert fly() == fly()
