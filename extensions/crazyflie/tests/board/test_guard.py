"""The guard of a Crazyflie: it lands one whose flight process is silent, and leaves all others."""

from __future__ import annotations

import struct

import pytest

from extensions.crazyflie.board.guard import SILENT_S, Guard
from extensions.crazyflie.board.messages import (
    DATA,
    EMERGENCY_STOPPED,
    MANUAL,
    SETPOINT,
    STOPPED,
    Info,
    arm,
    setpoint,
)
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.crtp.packets import CrtpPort, Packet
from vehicle.boards.board import BodyRates

FLOWN = setpoint(BodyRates((0.1, 0.0, 0.0), 0.5, 0.314), CrazyflieOptions())
HOVER = SETPOINT.unpack(FLOWN.data)[4]


class Watched:
    """A guard, the time, and a Crazyflie that tells its sensors each 10 ms."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.guard = Guard("cf", self.said.append)
        self.now_ms, self.height = 0, 0.0
        self.force, self.info = 1.0, int(Info.FLYING | Info.ARMED)

    def go(self, seconds: float, sent: Packet | None = None) -> list[Packet]:
        """Pass time, in which the flight process sends a packet each 10 ms; return the guard's."""
        own = []
        for _ in range(round(100 * seconds)):
            self.now_ms += 10
            if sent is not None:
                self.guard.passes(sent, 1e-3 * self.now_ms)
            stamp = self.now_ms.to_bytes(3, "little")
            pressure = 1000.0 - 0.116 * self.height
            status = struct.pack("<2fH", pressure, 3.9, self.info)
            imu = struct.pack("<6f", 0.0, 0.0, self.force, 0.0, 0.0, 0.0)
            for number, values in ((1, status), (0, imu)):
                packet = Packet(CrtpPort.LOG, DATA, bytes((number,)) + stamp + values)
                self.guard.hear(packet)
            own += self.guard.due(1e-3 * self.now_ms)
        return own

    def passes(self, packet: Packet) -> bool:
        return self.guard.passes(packet, 1e-3 * self.now_ms)

    def hover(self) -> None:
        self.go(1.0, STOPPED)
        self.height = 1.0
        assert self.go(4.0, FLOWN) == []


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_while_set_points_come_it_sends_none_and_passes_all(watched: Watched) -> None:
    watched.hover()
    assert watched.passes(FLOWN)
    assert watched.go(SILENT_S - 0.02) == []
    assert not watched.guard.lands


def test_after_a_silence_in_flight_it_descends_level_and_only_an_emergency_stop_passes(
    watched: Watched,
) -> None:
    watched.hover()
    first, *_ = watched.go(SILENT_S + 0.05)
    kind, roll, pitch, yaw_rate, thrust, is_rate = SETPOINT.unpack(first.data)
    assert (kind, roll, pitch, yaw_rate, is_rate) == (MANUAL, 0.0, 0.0, 0.0, 0)
    assert 0.7 * HOVER < thrust < HOVER
    assert watched.said == ["cf: no set-point for 0.25 s in flight; landing it"]
    assert not watched.passes(FLOWN)
    assert not watched.passes(STOPPED)  # what a flight process sends that has just started
    assert not watched.passes(arm(False))
    assert watched.passes(Packet(CrtpPort.PARAMETERS, 0, b"\x03"))
    assert watched.passes(EMERGENCY_STOPPED)
    assert watched.go(0.5) == []


def test_just_after_lift_off_it_begins_with_the_thrust_that_carries_it(watched: Watched) -> None:
    options = CrazyflieOptions()
    watched.go(1.0, STOPPED)
    watched.go(0.5, setpoint(BodyRates((0.0, 0.0, 0.0), 0.0, 0.05), options))  # motors idle
    for centimetres in range(21):
        watched.height = 0.01 * centimetres
        watched.go(0.02, FLOWN)
    first, *_ = watched.go(SILENT_S + 0.05)
    assert SETPOINT.unpack(first.data)[4] > 0.8 * HOVER


def test_once_landed_no_set_point_passes_until_the_flight_process_wants_the_motors_off(
    watched: Watched,
) -> None:
    watched.hover()
    own = watched.go(2.0)
    watched.height, watched.force = 0.0, 1.0
    own += watched.go(3.0)
    assert own[-2:] == [STOPPED, arm(False)]
    assert watched.said[-1] == "cf: landed, motors off"
    assert not watched.passes(FLOWN)  # of one that was frozen, and would take off again
    assert not watched.passes(arm(True))
    assert watched.passes(STOPPED)
    assert watched.passes(arm(True))
    assert watched.passes(FLOWN)


@pytest.mark.parametrize("info", [Info(0), Info.ARMED])
def test_one_that_does_not_fly_is_left_alone(watched: Watched, info: Info) -> None:
    watched.info = int(info)
    watched.go(1.0, FLOWN)
    assert watched.go(2.0) == []


def test_after_a_stop_set_point_it_is_left_alone(watched: Watched) -> None:
    watched.hover()
    watched.go(0.1, STOPPED)
    assert watched.go(2.0) == []


@pytest.mark.parametrize("lifted", [0.0, 0.15, 0.25, 0.4])
def test_the_ground_is_found_soon_although_a_force_that_began_in_the_air_still_lifts(
    watched: Watched, lifted: float
) -> None:
    """The force makes a newton of thrust seem to give more, in the air as on the ground."""
    watched.hover()
    climb, thrust, since_contact = 0.0, float(HOVER), 0.0
    for k in range(1000):
        own = watched.go(0.01)
        if STOPPED in own:
            break
        thrust = SETPOINT.unpack(own[-1].data)[4] if own else thrust
        is_down = watched.height <= 0.0
        given = thrust / HOVER + (lifted if k > 70 else 0.0)
        watched.force = max(given, 1.0 - climb / 0.0981) if is_down else given
        climb = max(0.0, climb) if is_down else climb + 0.01 * 9.81 * (given - 1.0)
        watched.height = max(0.0, watched.height + 0.01 * climb)
        since_contact += 0.01 if is_down else 0.0
    assert watched.said[-1] == "cf: landed, motors off"
    assert watched.height == 0.0
    assert 0.0 < since_contact < 0.6
