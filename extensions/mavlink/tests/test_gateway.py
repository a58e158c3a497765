"""A ground station flies through the gateway what the station lets it fly, and nothing else."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from extensions.mavlink import link as link_module
from extensions.mavlink.dialect import mavlink
from extensions.mavlink.peer import BYTES_A_SECOND, SAID_MOST, Peer
from extensions.mavlink.tests.wired import Wired
from quadrotor.errors import UsageError
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters, to_value
from vehicle_link.topics.control_inputs import decode_joy

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
ARM, TAKE_OFF = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF
GAIN = b"C_POSITION_KP_XY"


@pytest.fixture
def wire(tmp_path: Path) -> Iterator[Callable[..., Wired]]:
    """Yield a function that makes a gateway."""
    made: list[Wired] = []

    def make(**options: Any) -> Wired:
        made.append(Wired(tmp_path, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


def asked(wired: Wired) -> list[tuple[str, dict[str, Any]]]:
    """Return what the station was asked, with the arguments of behaviors as numbers."""
    return [
        (service, {k: from_parameters(v) if k == "arguments" else v for k, v in fields.items()})
        for _, service, fields in wired.station.asked
    ]


def test_telemetry_is_in_north_east_down(wire: Callable[..., Wired]) -> None:
    ground = wire().ground()
    ground.mav.system_time_send(0, 0)
    local = ground.until("LOCAL_POSITION_NED")
    assert (local.x, local.y, local.z) == (2.0, 1.0, -0.5)
    beat = ground.until("HEARTBEAT")
    assert beat.autopilot == mavlink.MAV_AUTOPILOT_GENERIC
    assert not beat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    place = ground.until("GLOBAL_POSITION_INT")
    assert place.relative_alt == 500
    assert place.lat == pytest.approx(47.4e7 + math.degrees(2.0 / 6371000.0) * 1e7, abs=1)
    assert ground.until("EXTENDED_SYS_STATE").landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    assert ground.until("HOME_POSITION").altitude == 0
    health = ground.until("SYS_STATUS")
    assert health.onboard_control_sensors_present & mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    assert health.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_GPS
    assert not health.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK


def test_a_vehicle_that_is_not_heard_has_no_heartbeat(wire: Callable[..., Wired]) -> None:
    wired = wire()
    wired.station.payloads.clear()
    ground = wired.ground()
    ground.mav.system_time_send(0, 0)
    for _ in range(10):
        ground.turn()
    assert ground.got == []


def test_commands_reach_the_station_as_its_own(wire: Callable[..., Wired]) -> None:
    wired = wire()
    ground = wired.ground()
    assert ground.command(ARM, 1.0) == ACCEPTED
    assert ground.command(TAKE_OFF, 0, 0, 0, math.nan, 0, 0, 0.8) == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4, 3) == ACCEPTED
    ground.mav.command_int_send(
        1,
        1,
        mavlink.MAV_FRAME_GLOBAL_INT,
        mavlink.MAV_CMD_DO_REPOSITION,
        0,
        0,
        0.5,
        0,
        0,
        0.0,
        round(47.4e7),
        round(8.5e7),
        1.2,
    )
    ground.until("COMMAND_ACK", lambda m: m.result == ACCEPTED)
    assert ground.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == ACCEPTED
    assert ground.command(ARM, 0, 21196) == ACCEPTED
    height = pytest.approx(0.8, abs=1e-6)
    goal = {"x": 0.0, "y": 0.0, "z": 1.2, "yaw": math.pi / 2.0, "speed": 0.5}
    assert asked(wired) == [
        ("arm", {}),
        ("start_behavior", {"name": "take_off", "arguments": {"height": height}}),
        ("start_behavior", {"name": "hover", "arguments": {}}),
        ("start_behavior", {"name": "fly_to", "arguments": pytest.approx(goal, abs=1e-6)}),
        ("start_behavior", {"name": "land", "arguments": {}}),
        ("emergency", {"action": "land"}),
        ("emergency", {"action": "cut"}),
    ]


def test_a_second_operator_is_refused_with_the_name_of_the_first(
    wire: Callable[..., Wired],
) -> None:
    wired = wire()
    wired.station.holder = "anna"
    ground = wired.ground()
    assert ground.command(ARM, 1.0) == DENIED
    assert ground.text("anna has control").startswith("anna has control; ask for it")
    assert ground.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == ACCEPTED


def test_a_viewer_gets_telemetry_and_may_only_land_in_an_emergency(
    wire: Callable[..., Wired],
) -> None:
    wired = wire(viewers=True)
    ground = wired.ground()
    assert ground.command(ARM, 1.0) == DENIED
    assert "ground stations are viewers" in ground.text("viewers")
    assert ground.command(ARM, 0, 21196) == DENIED
    ground.mav.mission_count_send(1, 1, 2)
    assert ground.until("MISSION_ACK").type == mavlink.MAV_MISSION_DENIED
    ground.mav.param_set_send(1, 1, GAIN, 5.0, mavlink.MAV_PARAM_TYPE_REAL32)
    ground.until("PARAM_ERROR")
    assert asked(wired) == []
    assert ground.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == ACCEPTED


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
def test_unsigned_messages_at_an_open_port_may_only_land_in_an_emergency(
    wire: Callable[..., Wired], kind: str
) -> None:
    wired = wire(kind=kind, unsigned=False)
    ground = wired.ground()
    for command in ((ARM, 1.0), (ARM, 0, 21196), (TAKE_OFF, 0, 0, 0, 0, 0, 0, 1)):
        assert ground.command(*command) == DENIED
    said = ground.text("may not command")
    for remedy in ("udpout:", "--passphrase", "--unsigned"):
        assert remedy in said
    ground.mav.set_position_target_local_ned_send(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0b110111111000, 3, 1, -0.5, *[0] * 8
    )
    ground.mav.manual_control_send(1, 0, 0, 500, 0, 1)
    ground.mav.mission_count_send(1, 1, 2)
    assert ground.until("MISSION_ACK").type == mavlink.MAV_MISSION_DENIED
    ground.mav.param_set_send(1, 1, GAIN, 5.0, mavlink.MAV_PARAM_TYPE_REAL32)
    ground.until("PARAM_ERROR")
    assert (asked(wired), wired.station.references, wired.station.sticks) == ([], [], [])
    assert ground.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1) == ACCEPTED


def test_the_ground_station_named_on_the_command_line_may_command_unsigned(
    wire: Callable[..., Wired],
) -> None:
    wired = wire(kind="udpout", unsigned=False)
    ground = wired.ground()
    ground.until("HEARTBEAT")
    assert ground.command(ARM, 1.0) == ACCEPTED


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
def test_what_does_not_begin_as_mavlink_is_not_searched_for_messages(
    wire: Callable[..., Wired], kind: str
) -> None:
    """A page of any web site can send MAVLink behind the head of a request."""
    wired = wire(kind=kind)
    ground = wired.ground()
    arm = ground.mav.command_long_encode(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(ground.mav)
    ground.write(b"POST / HTTP/1.1\r\nHost: 127.0.0.1:5760\r\n\r\n" + arm)
    for _ in range(5):
        ground.turn()
    assert asked(wired) == []
    assert wired.link.peers == []
    assert len(wired.lines) == 1
    assert "does not begin as MAVLink does" in wired.lines[0]


def test_a_command_that_is_not_known_is_unsupported(wire: Callable[..., Wired]) -> None:
    ground = wire().ground()
    assert ground.command(mavlink.MAV_CMD_DO_ORBIT) == mavlink.MAV_RESULT_UNSUPPORTED
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 1) == DENIED  # PX4's manual
    assert "mode 1.0 cannot be chosen" in ground.text("mode 1.0")


def test_a_repeated_command_is_done_once(wire: Callable[..., Wired]) -> None:
    wired = wire()
    ground = wired.ground()
    for _ in range(4):
        ground.mav.command_long_send(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    ground.until("COMMAND_ACK", lambda m: m.result == ACCEPTED)
    assert ground.command(ARM, 1.0) == ACCEPTED
    assert asked(wired) == [("arm", {})]


def test_parameters_are_listed_set_and_refused_with_the_vehicles_word(
    wire: Callable[..., Wired],
) -> None:
    wired = wire()
    ground = wired.ground()
    ground.mav.param_request_list_send(1, 1)
    first = ground.until("PARAM_VALUE")
    assert first.param_id == "M_MASS"
    assert first.param_value == pytest.approx(1.308)
    ground.until("PARAM_VALUE", lambda m: m.param_index == m.param_count - 1)
    ground.mav.param_set_send(1, 1, GAIN, 4.6, mavlink.MAV_PARAM_TYPE_REAL32)
    assert ground.until("PARAM_VALUE").param_value == pytest.approx(4.6)
    assert wired.station.store.get("control.position.kp_xy") == 4.6
    ground.mav.param_set_send(1, 1, GAIN, 400.0, mavlink.MAV_PARAM_TYPE_REAL32)
    assert ground.until("PARAM_ERROR").param_id == GAIN.decode()
    assert ground.until("PARAM_VALUE").param_value == pytest.approx(4.6)
    assert "= 400 is out of bounds; allowed 0 to 20 1/s2" in ground.text("kp_xy")
    change = new(
        "quadlab_msgs/ParameterChange", name="control.position.kp_xy", new_value=to_value(3.0)
    )
    wired.changes.put(change)
    assert ground.until("PARAM_VALUE").param_value == 3.0  # changed by another person
    ground.mav.param_request_read_send(1, 1, b"NO_SUCH", -1)
    assert ground.until("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST


def test_a_ground_station_is_told_about_on_so_many_lines_a_minute(
    wire: Callable[..., Wired],
) -> None:
    wired = wire()
    ground = wired.ground()
    for k in range(3 * SAID_MOST):
        ground.mav.param_set_send(1, 1, b"NO_%d" % k, 4.6, mavlink.MAV_PARAM_TYPE_REAL32)
        assert ground.until("PARAM_ERROR").param_id == f"NO_{k}"
    assert len(wired.lines) < 2 * SAID_MOST
    assert any("NO_0 is not there" in line for line in wired.lines)


def item(seq: int, command: int, east: float, north: float, up: float) -> tuple[Any, ...]:
    lat = 47.4 + math.degrees(north / 6371000.0)
    lon = 8.5 + math.degrees(east / (6371000.0 * math.cos(math.radians(47.4))))
    return (
        1,
        1,
        seq,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        command,
        0,
        1,
        0.0,
        0.0,
        0.0,
        math.nan,
        round(lat * 1e7),
        round(lon * 1e7),
        up,
    )


ITEMS = [
    item(0, mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 1.0),
    item(1, mavlink.MAV_CMD_NAV_WAYPOINT, 1.0, 0.5, 1.0),
    item(2, mavlink.MAV_CMD_NAV_WAYPOINT, 0.0, 0.0, 1.2),
    item(3, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0),
]


def upload(ground: Any, items: list[tuple[Any, ...]]) -> int:
    ground.mav.mission_count_send(1, 1, len(items))
    for k, one in enumerate(items):
        ground.until("MISSION_REQUEST_INT", lambda m, k=k: m.seq == k)
        ground.mav.mission_item_int_send(*one)
    return int(ground.until("MISSION_ACK").type)


def test_a_mission_is_flown_as_behaviors_one_after_the_other(wire: Callable[..., Wired]) -> None:
    wired = wire()
    ground = wired.ground()
    assert upload(ground, ITEMS) == mavlink.MAV_MISSION_ACCEPTED
    ground.mav.mission_request_list_send(1, 1)
    assert ground.until("MISSION_COUNT").count == 4
    ground.mav.mission_request_int_send(1, 1, 2)
    assert ground.until("MISSION_ITEM_INT").z == pytest.approx(1.2)
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.turn()
    for k, ends_in in ((0, "hover"), (2, "hover"), (3, "ground")):
        wired.station.show(ends_in, armed=ends_in == "hover", mode="armed")
        while ground.until("MISSION_ITEM_REACHED").seq != k:
            pass
        for _ in range(20):
            ground.turn()
    ground.text("mission flown")
    flown = [(fields["name"], fields["arguments"]) for _, fields in asked(wired)]
    assert [name for name, _ in flown] == ["take_off", "follow_trajectory", "land"]
    path = [[float(one) for one in p.split()] for p in flown[1][1]["waypoints"].split(";")]
    assert path[0] == pytest.approx([1.0, 0.5, 1.0], abs=0.011)
    assert path[1] == pytest.approx([0.0, 0.0, 1.2], abs=0.011)


def test_a_mission_ends_when_somebody_flies_something_else(wire: Callable[..., Wired]) -> None:
    wired = wire()
    ground = wired.ground()
    assert upload(ground, ITEMS) == mavlink.MAV_MISSION_ACCEPTED
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.turn()
    wired.station.show("velocity", armed=True, mode="armed")
    ground.text("mission ended: the vehicle does velocity")
    assert len(wired.station.asked) == 1


def test_a_mission_that_cannot_be_flown_is_refused_and_the_old_one_stays(
    wire: Callable[..., Wired],
) -> None:
    ground = wire().ground()
    assert upload(ground, ITEMS) == mavlink.MAV_MISSION_ACCEPTED
    orbit = [item(0, mavlink.MAV_CMD_NAV_LOITER_TURNS, 0, 0, 1)]
    assert upload(ground, orbit) == mavlink.MAV_MISSION_UNSUPPORTED
    assert "command 18 is not flown there" in ground.text("command 18")
    many = [item(k, mavlink.MAV_CMD_NAV_WAYPOINT, 0.1 * k, 0, 1) for k in range(13)]
    assert upload(ground, many) != mavlink.MAV_MISSION_ACCEPTED
    ground.mav.mission_request_list_send(1, 1)
    assert ground.until("MISSION_COUNT").count == 4


def test_a_ground_station_that_leaves_in_an_upload_changes_nothing(
    wire: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("extensions.mavlink.missions.ASKED_AGAIN", 0.0)
    wired = wire()
    ground = wired.ground()
    ground.mav.mission_count_send(1, 1, 4)
    ground.until("MISSION_ACK", lambda m: m.type == mavlink.MAV_MISSION_OPERATION_CANCELLED)
    assert "mission upload given up at item 0" in ground.text("given up")
    assert upload(wired.ground(254), ITEMS) == mavlink.MAV_MISSION_ACCEPTED


def test_offboard_needs_set_points_and_flies_them_smoothly(wire: Callable[..., Wired]) -> None:
    wired = wire()
    wired.station.show("hover", armed=True, mode="armed")
    ground = wired.ground()
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == DENIED
    assert "offboard needs set-points" in ground.text("set-points")
    send = ground.mav.set_position_target_local_ned_send
    only_position = 0b110111111000 | 1 << 10
    send(0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, only_position, 3, 1, -0.5, *[0] * 8)
    ground.turn()
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 7) == DENIED
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6, 0) == ACCEPTED
    assert wired.station.asked[-1][2]["name"] == "external"
    assert wired.station.references
    # No set-points any more: references stop, and one line says so.
    ground.text("offboard has ended: no set-points came; the vehicle brakes")
    count = len(wired.station.references)
    for _ in range(5):
        ground.turn()
    assert len(wired.station.references) == count


def test_runs_are_downloaded_whole(wire: Callable[..., Wired], tmp_path: Path) -> None:
    wired = wire()
    ground = wired.ground()
    ground.mav.log_request_list_send(1, 1, 0, 0xFFFF)
    assert ground.until("LOG_ENTRY").num_logs == 0
    contents = os.urandom(1000)
    file = tmp_path / "run.mcap"
    file.write_bytes(contents)
    run = type("Run", (), {"id": "run", "complete": True, "start_ns": 10**18})()
    catalogue = type("Runs", (), {"runs": lambda *_, **__: [run], "resolve": lambda *_: file})()
    wired.logs._catalogue = catalogue
    ground.mav.log_request_list_send(1, 1, 0, 0xFFFF)
    entry = ground.until("LOG_ENTRY")
    assert (entry.size, entry.num_logs, entry.time_utc) == (1000, 1, 10**9)
    ground.mav.log_request_data_send(1, 1, entry.id, 0, 2**32 - 1)
    arrived = bytearray()
    while len(arrived) < 1000:
        piece = ground.until("LOG_DATA")
        assert piece.ofs == len(arrived)
        arrived += bytes(piece.data[: piece.count])
    assert bytes(arrived) == contents
    ground.mav.log_request_data_send(1, 1, 7, 0, 90)
    ground.text("there is no log 7")


def test_events_are_sent_as_text(wire: Callable[..., Wired]) -> None:
    wired = wire()
    ground = wired.ground()
    ground.mav.system_time_send(0, 0)
    ground.turn()
    line = "braking: the link to the vehicle was lost for longer than a second, at (1.0, 2.0) m"
    wired.events.put(new("rcl_interfaces/Log", level=30, msg=line))
    assert ground.text("at (1.0, 2.0)") == line


# ---------------------------------------------------------------------- bad and too much
def test_noise_wrong_sums_and_other_systems_are_dropped_with_one_line(
    wire: Callable[..., Wired],
) -> None:
    wired = wire()
    ground = wired.ground()
    good = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(ground.mav)
    wrong = bytearray(good)
    wrong[-1] ^= 1
    for data in (
        bytes(wrong),
        b"\xfd",
        b"\xfd\xff\0",
        os.urandom(200).replace(b"\xfd", b"x"),
        b"?",
    ):
        for _ in range(3):
            ground.write(data)
    other = mavlink.MAVLink_command_long_message(9, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    ground.mav.send(other)
    for _ in range(5):
        ground.turn()
    assert asked(wired) == []
    assert [line for line in wired.lines if "sends invalid messages" in line] == wired.lines
    assert len(wired.lines) == 1
    assert ground.command(ARM, 1.0) == ACCEPTED, "what is half there does not spoil what follows"


def test_a_flood_is_dropped_before_it_is_parsed_and_others_are_served(
    wire: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    wired = wire()
    loud, quiet = wired.ground(250), wired.ground(255)
    assert quiet.command(ARM, 1.0) == ACCEPTED
    loud.mav.system_time_send(0, 0)
    loud.turn()
    parsed: list[int] = []
    parse = Peer.parse

    def noted(peer: Peer, data: bytes) -> list[Any]:
        parsed.append(len(data))
        return parse(peer, data)

    monkeypatch.setattr(Peer, "parse", noted)
    began, sent = time.monotonic(), 0
    while not any("more than 60 kB/s" in line for line in wired.lines) or sent < 2000:
        for _ in range(100):
            loud.mav.command_long_send(1, 1, 31_000, 0, 1, 0, 0, 0, 0, 0, 0)
        sent += 100
        loud.turn()
    passed = time.monotonic() - began
    assert sum(parsed) < (1.1 + passed) * BYTES_A_SECOND
    assert sum("more than 60 kB/s" in line for line in wired.lines) == 1
    assert quiet.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 1) == ACCEPTED


def test_a_second_operator_does_not_end_an_offboard_flight(wire: Callable[..., Wired]) -> None:
    wired = wire()
    wired.station.show("hover", armed=True, mode="armed")
    first, second = wired.ground(), wired.ground(254)
    for ground in (first, second):
        ground.mav.set_position_target_local_ned_send(
            0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0b110111111000, 2, 1, -0.5, *[0] * 8
        )
        ground.turn()
    assert first.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == ACCEPTED
    assert second.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == DENIED
    assert "flies offboard already" in second.text("already")
    first.text("no set-points came")


def test_only_so_many_ground_stations_are_served(wire: Callable[..., Wired]) -> None:
    wired = wire()
    grounds = [wired.ground(100 + k) for k in range(link_module.MOST + 2)]
    for ground in grounds:
        ground.mav.system_time_send(0, 0)
    grounds[0].until("HEARTBEAT")
    assert len(wired.link.peers) == link_module.MOST
    assert sum("one ground station too many" in line for line in wired.lines) == 1


def test_sticks_count_from_a_press_with_all_of_them_centred_until_the_button_is_released(
    wire: Callable[..., Wired],
) -> None:
    wired = wire()
    ground = wired.ground()
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 3) == ACCEPTED
    assert asked(wired) == [("start_behavior", {"name": "velocity", "arguments": {}})]

    def deflect(x: int, y: int, z: int, r: int, button: int) -> None:
        ground.mav.manual_control_send(1, x, y, z, r, button)
        ground.turn()

    deflect(800, 0, 500, 0, 1)
    ground.text("button 1 with all of them centred")
    assert wired.station.sticks == []
    deflect(0, 0, 500, 0, 0)
    deflect(0, 0, 500, 0, 1)
    deflect(800, 200, 750, -400, 1)
    deflect(800, 200, 750, 32767, 0)
    taken = [decode_joy(one) for one in wired.station.sticks]
    assert [one.enabled for one in taken] == [True, True, False]
    assert taken[1].axes == pytest.approx((0.8, -0.2, 0.5, 0.4))
    assert taken[2].axes == (0.0, 0.0, 0.0, 0.0)
    assert {one.requester for one in taken} == {wired.link.peers[0].name}


def test_over_tcp_a_message_may_come_in_pieces_and_a_closed_connection_gives_up_control(
    wire: Callable[..., Wired],
) -> None:
    wired = wire(kind="tcpin")
    ground = wired.ground()
    whole = ground.mav.command_long_encode(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(ground.mav)
    for piece in (whole[:7], whole[7:20], whole[20:]):
        ground.write(piece)
        ground.turn()
    acknowledged = ground.until("COMMAND_ACK", lambda m: m.result == ACCEPTED)
    assert acknowledged.command == ARM
    assert ground.until("LOCAL_POSITION_NED").x == 2.0
    ground.socket.close()
    end = time.monotonic() + 10.0
    while not wired.station.closed and time.monotonic() < end:
        wired.gateway.turn(0.01)
    assert len(wired.station.closed) == 1
    assert wired.link.peers == []
    assert any("has left" in line for line in wired.lines)


def test_over_tcp_those_that_say_or_read_nothing_hold_no_place_and_nobody_up(
    wire: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    wired = wire(kind="tcpin")
    silent = [wired.ground(100 + k) for k in range(link_module.MOST + 1)]
    for ground in silent:
        ground.turn()
    assert len(wired.link.peers) == link_module.MOST
    assert sum("one ground station too many" in line for line in wired.lines) == 1
    for peer in wired.link.peers:
        for _ in range(4000):  # nobody reads them
            peer.send(mavlink.MAVLink_system_time_message(0, 0))
    monkeypatch.setattr(link_module, "GONE", -1.0)
    wired.gateway.turn(0.0)
    assert wired.link.peers == []


def test_a_ground_station_that_leaves_gives_up_control(
    wire: Callable[..., Wired], monkeypatch: pytest.MonkeyPatch
) -> None:
    wired = wire()
    ground = wired.ground()
    assert ground.command(ARM, 1.0) == ACCEPTED
    name = wired.station.asked[0][0]
    assert name.startswith("mavlink 255 at 127.0.0.1:")
    monkeypatch.setattr(link_module, "GONE", -1.0)
    ground.turn()
    assert wired.link.peers == []
    assert wired.lines[-1] == f"{name} has left"
    assert [service for _, service, _ in wired.station.asked] == ["arm"], "no behavior is stopped"


@pytest.mark.parametrize(
    ("airborne", "holder", "disarms"),
    [(False, "", True), (True, "", False), (False, "anna", False)],
    ids=["on the ground", "in flight", "under another's control"],
)
def test_a_ground_station_that_leaves_a_vehicle_armed_on_the_ground_disarms_it(
    wire: Callable[..., Wired], airborne: bool, holder: str, disarms: bool
) -> None:
    wired = wire(kind="tcpin")
    ground = wired.ground()
    assert ground.command(ARM, 1.0) == ACCEPTED
    wired.station.show("hover" if airborne else "ground", armed=True, mode="armed")
    wired.station.show_status(airborne=airborne)
    wired.station.show_holder(holder or wired.link.peers[0].name)
    ground.socket.close()
    end = time.monotonic() + 10.0
    while not wired.station.closed and time.monotonic() < end:
        wired.gateway.turn(0.01)
    commands = [service for _, service, _ in wired.station.asked]
    assert commands == (["arm", "disarm"] if disarms else ["arm"])


def test_unsigned_messages_are_refused_where_a_passphrase_is_set(
    wire: Callable[..., Wired],
) -> None:
    wired = wire(passphrase="correct horse")
    for stranger in (wired.ground(), wired.ground(passphrase="battery staple")):
        stranger.mav.command_long_send(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        stranger.turn()
    assert asked(wired) == []
    ground = wired.ground(passphrase="correct horse")
    assert ground.command(ARM, 1.0) == ACCEPTED
    assert ground.until("HEARTBEAT").get_signed()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["serial:/dev/ttyUSB0"], "is not a connection; give udpin:ADDRESS:PORT"),
        (["udpin:127.0.0.1:0"], "is not a connection"),
        (["udpin:0.0.0.0:14550"], "0.0.0.0 is not this computer, and MAVLink has no sign-in"),
        (["--passphrase", "nowhere"], "--passphrase nowhere cannot be read"),
        (["--origin", "north"], "--origin north is not a place"),
    ],
)
def test_bad_options_are_refused_in_one_line(words: list[str], line: str) -> None:
    from quadlab.commands.parsing import parse

    with pytest.raises(UsageError, match=line):
        parse(["mavlink", *words]).run()
