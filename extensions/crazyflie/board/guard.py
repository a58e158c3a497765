"""A landing of the process that has the radio, for a Crazyflie whose flight process is silent.

Its firmware has no landing that starts when set-points end: after 0.5 s it levels out, after 2 s it
stops its motors. But set-points may come from anyone who has its radio. So whoever passes packets
on between flight process and radio watches them, and once no set-point came for `SILENT_S` sends
its own: level, at a climb rate held by the barometer, until the ground carries it.

Thrust is counted in units of the set-point: hovering is what the flight process needed to hover.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from extensions.crazyflie.board.messages import (
    COMMAND,
    DATA,
    EMERGENCY_STOP,
    IMU,
    MANUAL,
    PASCAL,
    SETPOINT,
    STATUS,
    STOPPED,
    THRUST_FULL,
    Info,
    arm,
)
from extensions.crazyflie.crtp.packets import CrtpPort, Packet
from quadrotor.vehicle_model import GRAVITY
from vehicle.safety.barometric_height import BarometricHeight
from vehicle.safety.blind_descent import BlindDescent
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.unloading import MOST, Unloading, Verdict

SILENT_S = 0.25
"""Time, in s, without a set-point after which it lands."""
AVERAGE_S, AVERAGE_LOW_S = 0.5, 0.1
"""Times, in s, of the thrust average that is the thrust in hover: above AIRBORNE, and below it,
where the average of a longer time is still that of idling motors."""
SINK, SINK_FLARE, FLARE_HEIGHT = 0.5, 0.35, 0.7
"""Descent rate in m/s, and that below a height in m above the place of the start."""
SLOWING, QUICKENING = 2.0, 1.0
"""Largest changes of the climb rate, m/s²: while it still climbs, and of the descent rate."""
CLIMB_GAIN, LIFT_GAIN = 5.0, 2.0
"""Gains of the climb rate control: 1/s, and of its integral 1/s²."""
THRUST_LEAST, THRUST_MOST = 0.4, 1.5
"""Limits of the thrust, as shares of that in hover."""
SUPPORT, DWELL_S = 0.1, 0.1
"""The ground is presumed, and tested, once it has carried this share of the weight for this time,
in s."""
STOPPED_SHARE, STOPPED_S, AGAIN_S = 0.3, 0.15, 0.5
"""The ground is presumed, too, once less than this share of the commanded descent was flown for
this time, in s; time, in s, from the start and from a test that found the air, in which it is not.
"""
AIRBORNE = 0.3
"""Height, in m by the barometer, above which the thrust carries it."""
_IMU, _STATUS = struct.Struct("<6f"), struct.Struct("<2fH")


class Guard:
    """The guard of one Crazyflie.

    Args:
        name: what it is called in lines.
        say: is given a line when a landing begins or ends.

    Attributes:
        lands: whether it flies it now. From then on set-points of the flight process are not
            passed on, until it is down and the flight process wants its motors off: one that was
            only frozen would take off again.
    """

    def __init__(self, name: str = "", say: Callable[[str], object] = lambda _: None) -> None:
        self._name, self._say = name, say
        self.lands = self._is_barred = False
        self._altitude, self._ground = BarometricHeight(), GroundContact()
        self._descent = BlindDescent(self._altitude, lambda line: say(f"{name}: {line}"))
        self._unloading = Unloading()
        self._pressure = self._climb_wanted = self._lift = self._hover = 0.0
        self._stopped_s = 0.0
        self._thrust = 0  # of the newest set-point
        self._setpoint_s = 0.0
        self._sample_ms: int | None = None
        self._is_flying = False
        self._due: list[Packet] = []

    def passes(self, packet: Packet, now_s: float) -> bool:
        """Note a packet of the flight process; return whether it may go up."""
        if packet.port == CrtpPort.SUPERVISOR and packet.channel == COMMAND:
            return self._passes_command(packet.data[:1])
        if packet.port != CrtpPort.SETPOINT:
            return True
        is_manual = packet.data[:1] == bytes((MANUAL,)) and len(packet.data) == SETPOINT.size
        self._is_barred = self._is_barred and (self.lands or is_manual)
        if self._is_barred:
            return False
        self._thrust = SETPOINT.unpack(packet.data)[4] if is_manual else 0
        self._setpoint_s = now_s
        return True

    def _passes_command(self, kind: bytes) -> bool:
        """Return whether a command to the supervisor may go up: while barred, the last resort."""
        if kind == bytes((EMERGENCY_STOP,)):
            self.lands, self._thrust = False, 0
            return True
        return not self._is_barred

    def hear(self, packet: Packet) -> None:
        """Note a packet of the Crazyflie."""
        if (packet.port, packet.channel) != (CrtpPort.LOG, DATA) or len(packet.data) < 4:
            return
        number, values = packet.data[0], packet.data[4:]
        if number == STATUS.number and len(values) == _STATUS.size:
            pressure, _, info = _STATUS.unpack(values)
            self._pressure, self._is_flying = PASCAL * pressure, bool(info & Info.FLYING)
        elif number == IMU.number and len(values) == _IMU.size and self._pressure > 0.0:
            ms = int.from_bytes(packet.data[1:4], "little")
            dt = 0.0 if self._sample_ms is None else 1e-3 * (ms - self._sample_ms & 0xFFFFFF)
            self._sample_ms = ms
            if dt > 0.0:  # not the first, and none that came twice
                self._sample(GRAVITY * _IMU.unpack(values)[2], min(dt, 0.1))

    def due(self, now_s: float) -> list[Packet]:
        """Return the packets that it sends now, and begin to land when that is due."""
        silent = now_s - self._setpoint_s > SILENT_S
        if not self.lands and self._is_flying and self._thrust > 0 and silent:
            self.lands, self._is_barred = True, True
            self._say(f"{self._name}: no set-point for {SILENT_S:g} s in flight; landing it")
            self._lift, self._climb_wanted = self._hover, self._altitude.climb
            self._ground.carried, self._stopped_s = 0.0, -AGAIN_S
            self._unloading.end()
        due, self._due = self._due, []
        return due

    def _sample(self, lift: float, dt: float) -> None:
        if not (self.lands or self._thrust):
            self._altitude.set_ground(self._pressure, dt)
            self._descent.rest()
            self._hover = 0.0
            return
        self._altitude.step(self._pressure, lift, dt)
        per_thrust = self._ground.lift_per_newton or GRAVITY / max(1.0, self._hover)
        self._unloading.observe(lift, per_thrust * self._thrust, dt)
        if self.lands:
            self._descent.watch(lift, SINK, dt)
            self._descend(dt)
        else:
            self._descent.follow(lift, None, dt)
            is_low = self._altitude.height < AIRBORNE
            average_s = AVERAGE_LOW_S if is_low else AVERAGE_S
            share = min(1.0, dt / average_s) if self._hover else 1.0
            self._hover += share * (self._thrust - self._hover)
            if is_low:
                self._ground.arm(0.0)  # the ground still carries it
        if not self._unloading.is_running:
            self._ground.observe(lift, float(self._thrust), SUPPORT, dt)

    def _is_down(self, dt: float) -> bool:
        """Return whether it stands on the ground, which is presumed first and tested then."""
        test = self._unloading
        is_stopped = self._altitude.climb > STOPPED_SHARE * self._climb_wanted
        waits = self._stopped_s < 0.0 or (is_stopped and self._climb_wanted < 0.0)
        self._stopped_s = self._stopped_s + dt if waits else 0.0
        is_presumed = self._ground.carried > DWELL_S or self._stopped_s > STOPPED_S
        if not (test.is_running or is_presumed):
            return False
        verdict = test.step(dt)
        if verdict is Verdict.AIR:
            test.end()
            self._ground.refute()
            self._stopped_s = -AGAIN_S
        return verdict is Verdict.GROUND

    def _descend(self, dt: float) -> None:
        if self._is_down(dt) or not self._is_flying:
            self._unloading.end()
            self.lands, self._thrust = False, 0
            self._due += [STOPPED, arm(False)]
            self._say(f"{self._name}: landed, motors off")
            return
        sink = SINK_FLARE if self._altitude.height < FLARE_HEIGHT else SINK
        change = -sink - self._climb_wanted
        most = dt * (SLOWING if self._climb_wanted > 0.0 else QUICKENING)
        self._climb_wanted += min(most, max(-most, change))
        climb = self._climb_wanted - self._descent.extra
        error = self._hover / GRAVITY * (climb - self._altitude.climb)
        least, most = THRUST_LEAST * self._hover, THRUST_MOST * self._hover
        if not self._unloading.is_running:
            self._lift = min(most, max(least, self._lift + LIFT_GAIN * error * dt))
        thrust = min(most, max(least, self._lift + CLIMB_GAIN * error))
        thrust = max((1.0 - MOST) * self._hover, thrust - self._unloading.share * self._hover)
        self._thrust = round(min(thrust, THRUST_FULL))
        level = SETPOINT.pack(MANUAL, 0.0, 0.0, 0.0, self._thrust, 0)
        self._due.append(Packet(CrtpPort.SETPOINT, 0, level))
