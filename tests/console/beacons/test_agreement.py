"""Station and vehicle agree on one layout of beacons, over the real link."""

from __future__ import annotations

from typing import Any

import pytest

from console.beacon_layout import STATION_LAYOUT, VEHICLE_LAYOUT
from quadrotor.errors import ParameterError
from quadrotor.motor_state import MotorState
from tests.waiting import until
from vehicle.modes import Mode
from vehicle_link.transport.parameter_service import ParameterClient


def test_a_vehicle_that_connects_is_told_follows_and_has_a_veto(linked: Any) -> None:
    assert linked.change(STATION_LAYOUT, "wide").accepted  # no vehicle to ask
    vehicle = linked.connect()
    assert vehicle.layout == "wide"

    assert linked.change(STATION_LAYOUT, "eight").accepted
    assert (linked.layout, vehicle.layout) == ("eight", "eight")
    on_board = ParameterClient(linked.page, "/quad1/vehicle")
    assert until(lambda: on_board.values()[VEHICLE_LAYOUT] == "eight")
    ids = vehicle.stack.navigation._beacons.ids
    assert ids == [1, 2, 3, 4, 5, 6, 7, 8]

    numbers = "5 2 2 0; 6 -2 2 0; 7 -2 -2 0; 8 2 -2 0"
    assert linked.change(STATION_LAYOUT, numbers).accepted
    assert (linked.layout, vehicle.layout) == (numbers, numbers)


def test_what_one_of_them_refuses_neither_has(linked: Any) -> None:
    vehicle = linked.vehicle or linked.connect()
    assert linked.change(STATION_LAYOUT, "paper").accepted
    wrong = linked.change(STATION_LAYOUT, "1 0 0 0; 2 1 0 0; 3 2 0 0; 4 3 0 0")
    assert not wrong.accepted
    assert "line" in wrong.reason
    assert (linked.layout, vehicle.layout) == ("paper", "paper")

    # As in flight on bearings: its beacons do not change.
    vehicle.stack.navigation.source = "bearings"
    vehicle.microcontroller.motor_state = MotorState.ON
    vehicle.stack.modes.mode = Mode.ARMED
    refused = linked.change(STATION_LAYOUT, "wide")
    vehicle.stack.modes.mode = Mode.READY
    vehicle.microcontroller.motor_state = MotorState.OFF
    vehicle.stack.navigation.source = "poses"
    assert not refused.accepted
    assert refused.reason.startswith(f"{STATION_LAYOUT} not changed, refused by the vehicle: ")
    assert "bearings" in refused.reason
    assert (linked.layout, vehicle.layout) == ("paper", "paper")
    with pytest.raises(ParameterError):
        linked.station.parts.store.change({STATION_LAYOUT: "1 0 0 0"}, "ada")
    assert (linked.layout, vehicle.layout) == ("paper", "paper")


def test_a_vehicle_that_connects_later_is_told_what_was_changed_without_it(linked: Any) -> None:
    if linked.vehicle is None:
        linked.connect()
    linked.disconnect()
    assert linked.change(STATION_LAYOUT, "ceiling").accepted
    vehicle = linked.connect()
    assert vehicle.layout == "ceiling"
    assert linked.layout == "ceiling"


def test_a_command_that_is_held_up_on_the_link_is_not_carried_out(
    linked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    if linked.vehicle is None:
        linked.connect()
    link = linked.station.link
    assert until(lambda: link.clock_known)
    took_off = linked.call("start_behavior", name="take_off").reason
    assert "late" not in took_off  # refused for other reasons, as it is on the ground
    passed = link.vehicle_ns() - 60_000_000_000
    monkeypatch.setattr(link, "vehicle_ns", lambda: passed)
    late = linked.call("start_behavior", name="take_off")
    assert not late.accepted
    assert "s too late over the link; send the command again" in late.reason
