"""Permission of the station to command its vehicle, and the reason for a refusal."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from console.link.permission import CommandPermission
from vehicle_link.topics.control_inputs import Heartbeat
from vehicle_link.transport.protocol import protocol, version

OURS, OTHER = 7, 9
VEHICLE, TWIN = 0xABCDEF << 40, 0x123456 << 40
SECOND = 1_000_000_000


def answer(access: str = "pilot", their_protocol: str = "") -> Any:
    return SimpleNamespace(access=access, protocol=their_protocol or protocol(), version=version())


def beat(instance: int = VEHICLE, holder: int = 0) -> Heartbeat:
    return Heartbeat(1, 0, instance, holder)


@pytest.fixture
def permission() -> CommandPermission:
    return CommandPermission("quad1", OURS)


def test_before_anything_is_heard_we_beat_and_nothing_is_wrong(
    permission: CommandPermission,
) -> None:
    assert (permission.sends_heartbeats, permission.sends_measurements) == (True, False)
    assert permission.problem(0) == ""


def test_a_vehicle_without_a_station_hears_our_heartbeats_before_our_poses(
    permission: CommandPermission,
) -> None:
    permission.heartbeat(beat(holder=0), 0)
    assert (permission.sends_heartbeats, permission.sends_measurements) == (True, False)
    permission.heartbeat(beat(holder=OURS), 1)
    assert (permission.sends_heartbeats, permission.sends_measurements) == (True, True)
    assert permission.problem(1) == ""


def test_another_stations_vehicle_gets_nothing_from_us_but_emergencies(
    permission: CommandPermission,
) -> None:
    permission.heartbeat(beat(holder=OTHER), 0)
    assert (permission.sends_heartbeats, permission.sends_measurements) == (False, False)
    reason = "another station (000000) flies quad1"
    assert permission.refusal("arm", 0) == f"{reason}; nothing was sent"
    permission.heartbeat(beat(holder=OTHER), SECOND)
    assert permission.problem(SECOND) == "", "it may be this one before it was started anew"
    permission.heartbeat(beat(holder=OTHER), 2 * SECOND)
    assert permission.problem(2 * SECOND) == reason
    assert permission.refusal("emergency", 0) == ""
    permission.heartbeat(beat(holder=0), 1)  # the holder has left
    assert permission.sends_heartbeats
    assert permission.refusal("arm", 1) == ""


def test_a_vehicle_that_does_not_say_who_it_is_takes_poses_from_anybody(
    permission: CommandPermission,
) -> None:
    permission.heartbeat(beat(instance=0), 0)
    assert (permission.sends_heartbeats, permission.sends_measurements) == (True, True)


def test_two_vehicles_of_one_name_are_told_apart_and_not_commanded(
    permission: CommandPermission,
) -> None:
    for k in range(6):
        permission.heartbeat(beat((VEHICLE, TWIN)[k % 2], OURS), k * SECOND // 20)
    now = 6 * SECOND // 20
    problem = permission.problem(now)
    assert problem.startswith("two vehicles are called quad1 (")
    assert "123456" in problem
    assert "abcdef" in problem
    assert problem.endswith("start one of them with another --name")
    assert permission.refusal("arm", now)
    assert permission.refusal("emergency", now) == ""
    for k in range(80):  # one of them is switched off
        permission.heartbeat(beat(VEHICLE, OURS), now + k * SECOND // 20)
    assert permission.problem(now + 80 * SECOND // 20) == ""


def test_a_vehicle_that_was_started_again_is_no_second_one(permission: CommandPermission) -> None:
    for k in range(8):  # a copy of its parent is there within half a second
        permission.heartbeat(beat(VEHICLE), k * SECOND // 20)
    for k in range(8, 40):
        permission.heartbeat(beat(TWIN), k * SECOND // 20)
        assert permission.problem(k * SECOND // 20) == ""


def test_an_observer_sends_nothing_not_even_emergencies(permission: CommandPermission) -> None:
    permission.note_identity(answer("observer"))
    permission.heartbeat(beat(), 0)
    assert not permission.sends_heartbeats
    reason = "this station's certificate lets it observe quad1, not command it; nothing was sent"
    assert permission.refusal("arm", 0) == permission.refusal("emergency", 0) == reason


def test_another_protocol_stops_commands_until_the_vehicle_is_another(
    permission: CommandPermission,
) -> None:
    permission.note_identity(answer(their_protocol="00000000"))
    assert "speaks protocol 00000000" in permission.refusal("change_parameters", 0)
    permission.forget_identity()
    assert "speaks protocol 00000000" in permission.problem(0), "it may be the same one"
    permission.note_identity(answer())
    assert permission.access == "pilot"
    assert permission.problem(0) == ""
