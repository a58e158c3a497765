"""The supervisor's table (docs/safety.md), trigger by trigger."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import pytest

from quadrotor.errors import RefusedError
from vehicle.modes import (
    CONTROL_MOVES,
    LEGAL_MOVES,
    ControlMode,
    Flag,
    Mode,
    check_control_move,
    check_move,
)
from vehicle.safety.parameters import REACTIONS, SafetyParameters
from vehicle.safety.supervisor import Reaction, Situation, Supervisor, Verdict

STEP_NS = 2_000_000
WELL: dict[str, Any] = {"voltage": 15.0, "pose_age": 0.0, "tilt": 0.0}


class Flight:
    """Supervisor stepped at 500 Hz, with the times of its reactions."""

    def __init__(self, **thresholds: Any) -> None:
        self.supervisor = Supervisor(SafetyParameters(**thresholds))
        self.now_ns = 1_000_000_000
        self.supervisor.heartbeat(self.now_ns)
        self.supervisor.begin_flight()

    def fly(
        self, seconds: float, *, heard: bool = True, airborne: bool = True, **measured: Any
    ) -> list[tuple[float, Verdict]]:
        began, found = self.now_ns, []
        while self.now_ns - began < seconds * 1e9:
            self.now_ns += STEP_NS
            if heard:
                self.supervisor.heartbeat(self.now_ns)
            situation = Situation(airborne=airborne, **WELL | measured)
            verdict = self.supervisor.step(self.now_ns, situation)
            if verdict is not None:
                found.append(((self.now_ns - began) * 1e-9, verdict))
        return found


def test_a_healthy_flight_meets_no_reaction() -> None:
    flight = Flight()
    assert flight.fly(5.0) == []
    assert flight.supervisor.flags == Flag.NONE


def test_a_silent_station_makes_it_brake_then_land_once_each() -> None:
    flight = Flight(link_timeout=0.4, link_land_after=2.0)
    reactions = flight.fly(10.0, heard=False)
    assert [verdict.reaction for _, verdict in reactions] == [Reaction.BRAKE, Reaction.LAND]
    assert reactions[0][0] == pytest.approx(0.4, abs=0.005)
    assert reactions[1][0] == pytest.approx(2.4, abs=0.005)
    assert "station" in reactions[0][1].reason


def test_a_station_that_comes_back_in_time_ends_it_with_braking() -> None:
    flight = Flight(link_timeout=0.4, link_land_after=2.0)
    assert [v.reaction for _, v in flight.fly(1.0, heard=False)] == [Reaction.BRAKE]
    assert flight.fly(5.0) == []
    assert [v.reaction for _, v in flight.fly(1.0, heard=False)] == [Reaction.BRAKE]


def test_on_the_ground_a_silent_station_is_flagged_but_moves_nothing() -> None:
    flight = Flight()
    assert flight.fly(5.0, heard=False, airborne=False) == []
    assert flight.supervisor.flags & Flag.LINK_LOST


def test_a_lost_pose_lands_only_after_its_time() -> None:
    flight = Flight(pose_land_after=1.0)
    assert flight.fly(1.0, pose_age=0.9) == []
    reactions = flight.fly(1.0, pose_age=1.1)
    assert [v.reaction for _, v in reactions] == [Reaction.DESCEND]
    assert "1.1 s" in reactions[0][1].reason


def silent_for_a_second_and_a_half(flight: Flight) -> None:
    """Fly with a lost link: neither heartbeat nor pose for 1.5 s."""
    assert [v.reaction for _, v in flight.fly(0.5, heard=False)] == [Reaction.BRAKE]
    assert flight.fly(1.0, heard=False, pose_age=1.5) == []


def test_a_link_that_comes_back_may_bring_its_pose_a_moment_after_its_heartbeat() -> None:
    flight = Flight(link_timeout=0.4, pose_land_after=1.0)
    silent_for_a_second_and_a_half(flight)
    assert flight.fly(0.35, pose_age=1.8) == []
    assert flight.fly(5.0, pose_age=0.01) == []


def test_a_link_that_comes_back_without_poses_lands() -> None:
    flight = Flight(link_timeout=0.4, pose_land_after=1.0)
    silent_for_a_second_and_a_half(flight)
    [(after, verdict)] = flight.fly(2.0, pose_age=1.8)
    assert verdict.reaction is Reaction.DESCEND
    assert after == pytest.approx(0.4, abs=0.005)


def test_single_heartbeats_do_not_keep_it_in_the_air_without_poses() -> None:
    flight = Flight(link_timeout=0.4, link_land_after=2.0, pose_land_after=1.0)
    silent_for_a_second_and_a_half(flight)
    pose_age = 1.5
    found: list[Reaction] = []
    while pose_age < 10.0 and not found:
        assert [v.reaction for _, v in flight.fly(0.5, heard=False, pose_age=pose_age)] in (
            [],
            [Reaction.BRAKE],
        )
        pose_age += 0.5
        found = [v.reaction for _, v in flight.fly(0.002, pose_age=pose_age)]
    assert found == [Reaction.DESCEND]
    assert pose_age == pytest.approx(3.5)


def test_a_low_battery_must_stay_low_for_its_delay() -> None:
    flight = Flight(battery_land=13.1, battery_delay=1.0)
    assert flight.fly(0.9, voltage=13.0) == []
    assert flight.fly(0.1, voltage=15.0) == []
    reactions = flight.fly(2.0, voltage=13.0)
    assert [v.reaction for _, v in reactions] == [Reaction.EMERGENCY]
    assert reactions[0][0] == pytest.approx(1.0, abs=0.01)


def test_a_battery_between_warning_and_landing_is_only_flagged() -> None:
    flight = Flight(battery_warning=13.8, battery_land=13.1)
    assert flight.fly(3.0, voltage=13.5) == []
    assert flight.supervisor.flags & Flag.BATTERY_LOW


def test_a_battery_found_empty_on_the_ground_still_lands_the_flight_that_follows() -> None:
    flight = Flight(battery_land=13.1, battery_delay=1.0)
    assert flight.fly(3.0, airborne=False, voltage=13.0) == []
    assert [v.reaction for _, v in flight.fly(1.0, voltage=13.0)] == [Reaction.EMERGENCY]


def test_a_vehicle_that_turned_over_stops_its_motors() -> None:
    reactions = Flight(tilt_cut=100.0).fly(1.0, tilt=math.radians(101.0))
    assert [v.reaction for _, v in reactions] == [Reaction.CUT]


# The measured quantity, its delay (s), its parameter, the default reaction, a word of the reason.
TRIGGERS = [
    ({"tilt": math.radians(75.0)}, "tilt", 0.2, Reaction.EMERGENCY, "tilt 75°"),
    ({"innovation": 0.7}, "innovation", 0.3, Reaction.DESCEND, "0.70 m from their prediction"),
    ({"innovation": math.nan}, "innovation", 0.3, Reaction.DESCEND, "estimate diverged"),
    ({"innovation": 0.7, "jumped": True}, "innovation", 0.3, Reaction.DESCEND, "tracker jumped"),
    ({"pose_age": 1.2}, "pose", 0.0, Reaction.DESCEND, "no pose measurement for 1.2 s"),
    ({"outside": 0.6}, "volume", 0.2, Reaction.LAND, "0.6 m outside the flight volume"),
    ({"box": "pillar"}, "volume", 0.2, Reaction.LAND, "in the keep-out box pillar"),
    ({"speed": 6.5}, "speed", 0.2, Reaction.BRAKE, "6.5 m/s"),
    ({"saturated": True}, "saturation", 1.0, Reaction.LAND, "saturated for 1 s"),
    ({"lost_ports": 1}, "port", 0.0, Reaction.LAND, "serial port"),
    ({"tilt": math.radians(120.0)}, "tilt_cut", 0.0, Reaction.CUT, "turned over"),
    ({"voltage": 12.9}, "battery", 1.0, Reaction.EMERGENCY, "battery at 12.9 V"),
]


@pytest.mark.parametrize(("measured", "name", "delay", "reaction", "reason"), TRIGGERS)
def test_every_trigger_reacts_once_after_its_delay_and_as_it_is_told(
    measured: dict[str, Any], name: str, delay: float, reaction: Reaction, reason: str
) -> None:
    [(after, verdict)] = Flight().fly(3.0, **measured)
    assert after == pytest.approx(delay, abs=0.005)
    assert (verdict.reaction, reason in verdict.reason) == (reaction, True), verdict
    for other in REACTIONS:
        found = Flight(**{f"{name}_reaction": other}).fly(3.0, **measured)
        wanted = [] if other == "none" else [Reaction[other.upper()]]
        assert [v.reaction for _, v in found] == wanted


@pytest.mark.parametrize(("measured", "name", "delay", "reaction", "reason"), TRIGGERS)
def test_what_lasts_too_short_or_happens_on_the_ground_is_nothing(
    measured: dict[str, Any], name: str, delay: float, reaction: Reaction, reason: str
) -> None:
    assert Flight().fly(3.0, airborne=False, **measured) == []
    if delay:
        flight = Flight()
        for _ in range(5):
            assert flight.fly(0.9 * delay, **measured) == []
            assert flight.fly(0.01) == []


def test_while_the_microcontroller_holds_the_angles_the_estimate_may_be_wrong() -> None:
    bad: dict[str, Any] = {"innovation": math.nan, "pose_age": 9.0, "outside": 9.0, "speed": 99.0}
    assert Flight().fly(3.0, by_microcontroller=True, **bad) == []
    reactions = Flight().fly(3.0, by_microcontroller=True, voltage=12.0, **bad)
    assert [v.reaction for _, v in reactions] == [Reaction.EMERGENCY]
    reactions = Flight().fly(3.0, by_microcontroller=True, outside=0.6, speed=6.5)
    assert [v.reaction for _, v in reactions] == [Reaction.LAND, Reaction.BRAKE], "a known place"


def test_a_cause_that_has_reacted_or_is_to_be_ignored_hides_no_other() -> None:
    flight = Flight(tilt_reaction="none")
    reactions = flight.fly(
        3.0,
        tilt=math.radians(75.0),
        innovation=math.nan,
        outside=2.0,
        saturated=True,
        speed=9.0,
        voltage=12.0,
        lost_ports=1,
    )
    assert Counter(v.reaction for _, v in reactions) == {
        Reaction.DESCEND: 1,
        Reaction.LAND: 3,
        Reaction.BRAKE: 1,
        Reaction.EMERGENCY: 1,
    }


def test_the_names_of_reactions_are_those_of_the_parameters() -> None:
    assert tuple(reaction.name.lower() for reaction in Reaction) == REACTIONS


@pytest.mark.parametrize("current", list(ControlMode))
@pytest.mark.parametrize("wanted", list(ControlMode))
def test_out_of_the_emergency_leads_no_control_mode(
    current: ControlMode, wanted: ControlMode
) -> None:
    if wanted is current or wanted in CONTROL_MOVES[current]:
        check_control_move(current, wanted)
        assert current is not ControlMode.EMERGENCY or wanted is current
    else:
        with pytest.raises(RefusedError, match="until the motors are off"):
            check_control_move(current, wanted)


@pytest.mark.parametrize("current", list(Mode))
@pytest.mark.parametrize("wanted", list(Mode))
def test_every_move_between_modes_is_the_tables(current: Mode, wanted: Mode) -> None:
    if wanted in LEGAL_MOVES[current]:
        check_move(current, wanted)
    else:
        with pytest.raises(RefusedError, match=current.name.lower()):
            check_move(current, wanted)


def test_an_imu_that_is_suspect_is_landed_with_once() -> None:
    flight = Flight()
    why = "an axis of the gyroscope is stuck"
    found = flight.fly(2.0, inertial=why)
    assert [verdict for _, verdict in found] == [Verdict(Reaction.LAND, why)]
    assert Flight(inertial_reaction="none").fly(2.0, inertial=why) == []
