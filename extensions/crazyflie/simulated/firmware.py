"""A simulated Crazyflie behind the interface of the simulated microcontroller.

It speaks CRTP 12 as the firmware documents it: link, platform, parameters, log, set-points, poses
and supervisor. What a client asks beyond that has no answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from extensions.crazyflie.board.guard import Guard
from extensions.crazyflie.board.messages import (
    ARM,
    EMERGENCY_STOP,
    INFO,
    MANUAL,
    OLDEST,
    PASCAL,
    POSE,
    POSE_DATA,
    SETPOINT,
    STOP,
    VERSION,
)
from extensions.crazyflie.crtp.links import UDP_PORT
from extensions.crazyflie.crtp.packets import CrtpPort, FrameReader, Packet, decode, frame
from extensions.crazyflie.crtp.udp import UdpServer
from extensions.crazyflie.simulated.inner_loop import AXES, RATE_STEP_S, Estimate, InnerLoop
from extensions.crazyflie.simulated.radio import Radio
from extensions.crazyflie.simulated.supervisor import Supervisor
from extensions.crazyflie.simulated.variables import LOG_FLOAT, LOG_WORD, LogPort, ParameterPort
from quadrotor.rotations import rotate_inverse
from quadrotor.vehicle_model import GRAVITY, Four
from vehicle.simulator.board_firmware import PERIOD_US, BoardFirmware
from vehicle.simulator.parameters import SimulatorParameters

CELLS = 4
"""Number of cells of the plant's battery, of which a Crazyflie has one."""
STILL_MS = 500
"""Time, in ms, after its start, over which it averages its gyroscope's drift."""
RATE_STEP = round(1e6 * RATE_STEP_S) // PERIOD_US
SOURCE = b"Bitcraze Crazyflie".ljust(30, b"\0")
FIRMWARE, DEVICE = b"quadlab simulation", b"CF2.1"
CONSOLE = b"SYS: simulated Crazyflie\n"
ALL_INFO = 12
UP = np.array((0.0, 0.0, 1.0))


class CrazyflieFirmware(BoardFirmware):
    """One simulated Crazyflie, and the guard in the process that has its radio.

    Args:
        udp_port: where it is served, unless its port is in memory.

    Attributes:
        supervisor: its supervisor.
        parameters: its parameters.
        guard: whoever lands it from the ground when the flight process is silent; None: nobody.
    """

    def __init__(self, udp_port: int = UDP_PORT) -> None:
        super().__init__()
        self._udp_port = udp_port
        self.supervisor, self.parameters = Supervisor(), ParameterPort()
        self._estimate, self._loop = Estimate(), InnerLoop()
        self._up, self._down = Radio(), Radio()
        self.guard: Guard | None = Guard()
        self._has_radio = True
        self._frames = FrameReader()
        self._now_ms = -1
        self._drift, self._still = np.zeros(3), 0
        self._rates = self._force = (0.0, 0.0, 0.0)
        self._wanted, self._is_rate, self._thrust = (0.0, 0.0, 0.0), False, 0
        self._setpoint_ms = 0
        self._has_failed = False
        self._logs = LogPort(self._variables())

    def configure(self, parameters: SimulatorParameters) -> None:
        for k, radio in enumerate((self._up, self._down)):
            if self._now_ms < 0:
                radio.seed(2 * parameters.seed + k)
            radio.delay_ms = round(1e3 * parameters.radio_delay)
            radio.loss = parameters.radio_loss
        self._has_radio = not parameters.unplugged[0]

    def _variables(self) -> dict[str, tuple[int, Callable[[], float]]]:
        found: dict[str, tuple[int, Callable[[], float]]] = {}
        for k, axis in enumerate("xyz"):
            found[f"acc.{axis}"] = LOG_FLOAT, partial(self._acceleration, k)
            found[f"gyro.{axis}"] = LOG_FLOAT, partial(self._rate, k)
            found[f"stateEstimate.{axis}"] = LOG_FLOAT, partial(self._position, k)
        for k, angle in enumerate(AXES):
            found[f"stateEstimate.{angle}"] = LOG_FLOAT, partial(self._angle, k)
        return found | {
            "baro.pressure": (LOG_FLOAT, lambda: self._pressure / PASCAL),
            "pm.vbat": (LOG_FLOAT, lambda: self.voltage / CELLS),
            "supervisor.info": (LOG_WORD, lambda: self.supervisor.info),
        }

    def _acceleration(self, k: int) -> float:
        return self._force[k] / GRAVITY

    def _rate(self, k: int) -> float:
        return math.degrees(self._rates[k])

    def _position(self, k: int) -> float:
        return self._estimate.position_w[k]

    def _angle(self, k: int) -> float:
        return self._estimate.degrees[k]

    # ------------------------------------------------------------------ the link
    def receive(self, port: int, data: bytes) -> bytes:
        for packet in self._frames.feed(data):
            if self.guard is None or self.guard.passes(decode(packet), 1e-3 * self._now_ms):
                self._up.put(packet, self._now_ms)
        return b""

    def next_data(self) -> tuple[int, bytes]:
        packets = self._down.take(self._now_ms)
        if self.guard is not None and self._has_radio:
            for packet in packets:
                self.guard.hear(decode(packet))
            for own in self.guard.due(1e-3 * self._now_ms):
                self._up.put(own.encode(), self._now_ms)
        return 0, b"".join(map(frame, packets))

    def _send(self, packet: Packet | None) -> None:
        if packet is not None:
            self._down.put(packet.encode(), self._now_ms)

    def _take(self, packet: Packet) -> None:
        port, channel, data = packet.port, packet.channel, packet.data
        if port == CrtpPort.PARAMETERS:
            self._send(self.parameters.answer(channel, data))
        elif port == CrtpPort.LOG:
            self._send(self._logs.answer(channel, data, self._now_ms))
        elif port == CrtpPort.SETPOINT and channel == 0 and data:
            self._take_setpoint(data)
        elif port == CrtpPort.LOCALIZATION and channel == 1 and data[:1] == bytes((POSE,)):
            if len(data) == POSE_DATA.size and self.parameters.values["stabilizer.estimator"] == 2:
                _, x, y, z, i, j, k, w = POSE_DATA.unpack(data)
                self._estimate.correct((x, y, z), (w, i, j, k))
        elif port == CrtpPort.SUPERVISOR and data:
            self._take_supervisor(channel, data)
        elif port == CrtpPort.PLATFORM and channel == VERSION and data:
            told = {0: bytes((OLDEST,)), 1: FIRMWARE + b"\0", 2: DEVICE + b"\0"}.get(data[0], b"")
            self._send(Packet(port, channel, data[:1] + told))
        elif port == CrtpPort.MEMORY and channel == 0:
            self._send(Packet(port, channel, data[:1] + b"\0"))  # it has no memories
        elif port == CrtpPort.LINK and channel == 0:
            self._send(packet)
        elif port == CrtpPort.LINK and channel == 1:
            self._send(Packet(port, channel, SOURCE))
            self._send(Packet(CrtpPort.CONSOLE, 0, CONSOLE))
        elif packet.is_null:
            self._send(packet)  # by which scans over UDP find it

    def _take_setpoint(self, data: bytes) -> None:
        if data[0] == STOP:
            self._wanted, self._thrust = (0.0, 0.0, 0.0), 0
        elif data[0] == MANUAL and len(data) == SETPOINT.size:
            _, roll, pitch, yaw_rate, self._thrust, rate = SETPOINT.unpack(data)
            self._wanted, self._is_rate = (roll, pitch, yaw_rate), bool(rate)
        else:
            return
        self._setpoint_ms = self._now_ms

    def _take_supervisor(self, channel: int, data: bytes) -> None:
        answer = bytes((data[0] | 0x80,))
        if channel == INFO:
            info = int(self.supervisor.info)
            is_all = data[0] == ALL_INFO
            rest = info.to_bytes(2, "little") if is_all else bytes((info >> data[0] - 1 & 1,))
            self._send(Packet(CrtpPort.SUPERVISOR, channel, answer + rest))
        elif data[0] == ARM and len(data) == 2:
            done = self.supervisor.arm(bool(data[1]))
            rest = bytes((done, self.supervisor.armed))
            self._send(Packet(CrtpPort.SUPERVISOR, channel, answer + rest))
        elif data[0] == EMERGENCY_STOP:
            self.supervisor.locked = True

    # ------------------------------------------------------------------ the flight
    def period(self, command: tuple[int, int, int, int]) -> None:
        self._now_ms += 1
        if self._has_failed:
            return
        self._read_sensors()
        for packet in self._up.take(self._now_ms):
            self._take(decode(packet))
        if self._now_ms % RATE_STEP == 0:
            self._turn(self._motors())
        for block in self._logs.due(self._now_ms):
            self._send(block)

    def _read_sensors(self) -> None:
        force, rates = self._sensed
        if self._still < STILL_MS:
            self._still += 1
            self._drift += (rates - self._drift) / self._still
        x, y, z = force.tolist()
        p, q, r = (rates - self._drift).tolist()
        self._force, self._rates = (x, y, z), (p, q, r)

    def _motors(self) -> Four:
        estimate, supervisor = self._estimate, self.supervisor
        estimate.predict(self._rates, self._force)
        up = rotate_inverse(estimate.quaternion_wb, UP)
        has_thrust = any(self.references)
        supervisor.step(self._now_ms, self._setpoint_ms, float(up[2]), has_thrust)
        thrust = self._thrust if supervisor.can_fly else 0
        is_level = supervisor.levels_out
        wanted = (0.0, 0.0, 0.0) if is_level else self._wanted
        is_rate = self._is_rate and not is_level
        gains, degrees = self.parameters.values, estimate.degrees
        # A motor's thrust is the square of its reference, as with the firmware's compensation.
        a, b, c, d = self._loop.step(gains, wanted, is_rate, thrust, self._rates, degrees)
        return math.sqrt(a), math.sqrt(b), math.sqrt(c), math.sqrt(d)

    def open_port(self, link: Path) -> UdpServer:
        """Return its end of CRTP over UDP. Raises LinkError."""
        return UdpServer(self._udp_port)

    def fail(self) -> None:
        self._has_failed = True
        self.references = (0.0, 0.0, 0.0, 0.0)
