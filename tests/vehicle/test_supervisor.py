"""The supervisor's table (docs/safety.md), trigger by trigger."""

from __future__ import annotations

import math

import pytest

from quadrotor.errors import RefusedError
from vehicle.modes import LEGAL_MOVES, Flag, Mode, check_move
from vehicle.parameters import SafetyParameters
from vehicle.supervisor import Reaction, Supervisor, Verdict

STEP_NS = 2_000_000
WELL = {"voltage": 15.0, "pose_age": 0.0, "tilt": 0.0}


class Flight:
    """Steps a supervisor at 500 Hz and remembers when it reacted."""

    def __init__(self, **thresholds: float) -> None:
        self.supervisor = Supervisor(SafetyParameters(**thresholds))
        self.now_ns = 1_000_000_000
        self.supervisor.heard(self.now_ns)
        self.supervisor.begin_flight()

    def fly(
        self, seconds: float, *, heard: bool = True, airborne: bool = True, **measured: float
    ) -> list[tuple[float, Verdict]]:
        began, found = self.now_ns, []
        while self.now_ns - began < seconds * 1e9:
            self.now_ns += STEP_NS
            if heard:
                self.supervisor.heard(self.now_ns)
            verdict = self.supervisor.step(self.now_ns, airborne=airborne, **WELL | measured)
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
    assert [v.reaction for _, v in reactions] == [Reaction.LAND]
    assert "1.1 s" in reactions[0][1].reason


def test_a_low_battery_must_stay_low_for_its_delay() -> None:
    flight = Flight(battery_land=13.1, battery_delay=1.0)
    assert flight.fly(0.9, voltage=13.0) == []
    assert flight.fly(0.1, voltage=15.0) == []
    reactions = flight.fly(2.0, voltage=13.0)
    assert [v.reaction for _, v in reactions] == [Reaction.LAND]
    assert reactions[0][0] == pytest.approx(1.0, abs=0.01)


def test_a_battery_between_warning_and_landing_is_only_flagged() -> None:
    flight = Flight(battery_warning=13.8, battery_land=13.1)
    assert flight.fly(3.0, voltage=13.5) == []
    assert flight.supervisor.flags & Flag.BATTERY_LOW


def test_a_battery_found_empty_on_the_ground_still_lands_the_flight_that_follows() -> None:
    flight = Flight(battery_land=13.1, battery_delay=1.0)
    assert flight.fly(3.0, airborne=False, voltage=13.0) == []
    assert [v.reaction for _, v in flight.fly(1.0, voltage=13.0)] == [Reaction.LAND]


def test_a_vehicle_that_turned_over_stops_its_motors() -> None:
    reactions = Flight(tilt_cut=100.0).fly(1.0, tilt=math.radians(101.0))
    assert [v.reaction for _, v in reactions] == [Reaction.CUT]


@pytest.mark.parametrize("current", list(Mode))
@pytest.mark.parametrize("wanted", list(Mode))
def test_every_move_between_modes_is_the_tables(current: Mode, wanted: Mode) -> None:
    if wanted in LEGAL_MOVES[current]:
        check_move(current, wanted)
    else:
        with pytest.raises(RefusedError, match=current.name.lower()):
            check_move(current, wanted)
