"""Search for devices: real pseudo-terminals, with the simulated firmware or a faulty one."""

from __future__ import annotations

import os
import random
import select
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from serial.tools import list_ports

from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware.firmware import Firmware
from vehicle_link.serial.commands import (
    decode_value,
    encode_data,
    encode_mirrored,
    encode_set,
    encode_value,
)
from vehicle_link.serial.devices import (
    await_devices,
    candidates,
    choose_ports,
    controllers,
    find_ports,
)
from vehicle_link.serial.discovery import STALE_MS, Clock, Device, Finding, discover
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import Id
from vehicle_link.serial.serial_port import SerialPort


class Robot(threading.Thread):
    """Microcontroller behind pseudo-terminals, in real time; subclasses spoil its lines."""

    def __init__(self, ports: int = 2, robot_id: int = 1, revision: int = 1, age_ms: int = 0):
        super().__init__(daemon=True)
        self.firmware = Firmware(ports)
        self.firmware.registers[Id.ROBOT_ID] = robot_id
        self.firmware.registers[Id.FIRMWARE_REVISION] = revision
        self.heard = b""
        self.stopping = threading.Event()
        self._age_ms = age_ms
        pairs = [os.openpty() for _ in range(ports)]
        self.masters, self.slaves = [p[0] for p in pairs], [p[1] for p in pairs]
        for master, slave in pairs:
            tty.setraw(slave)
            os.set_blocking(master, False)
        self.paths = [os.ttyname(slave) for slave in self.slaves]

    def run(self) -> None:
        begun = time.monotonic()
        while not self.stopping.is_set():
            for master in select.select(self.masters, [], [], 0.002)[0]:
                data = os.read(master, 4096)
                self.heard += data
                self.write(master, self.firmware.receive(self.masters.index(master), data))
                if self.stopping.is_set():
                    return
            self.firmware.advance(self._age_ms + int(1e3 * (time.monotonic() - begun)))
            index, data = self.firmware.next_data()
            self.write(self.masters[index], data)

    def write(self, master: int, data: bytes) -> None:
        with suppress(BlockingIOError):  # no reader
            os.write(master, self.spoil(data))

    def spoil(self, data: bytes) -> bytes:
        return data

    def close(self) -> None:
        self.stopping.set()
        self.join(10.0)
        self.hang_up()

    def hang_up(self) -> None:
        while self.masters:
            os.close(self.slaves.pop())
            os.close(self.masters.pop())


class Mute(Robot):
    def spoil(self, data: bytes) -> bytes:
        return b""


class Slow(Robot):
    """Sends at 38400 Bd to a receiver at 115200: every bit is seen three times."""

    def spoil(self, data: bytes) -> bytes:
        bits = "".join("0" + f"{byte:08b}"[::-1] + "1" for byte in data)
        seen = "".join(bit * 3 for bit in bits) + "1" * 10
        out, at = bytearray(), 0
        while (at := seen.find("0", at)) >= 0 and at + 10 <= len(seen):
            out.append(int(seen[at + 1 : at + 9][::-1], 2))
            at += 10
        return bytes(out)


class Deaf(Robot):
    """Sends samples, but receives nothing."""

    def spoil(self, data: bytes) -> bytes:
        return data if data.startswith(b"#bD") else b""


class Forgetful(Robot):
    """Reports its identity and nothing more."""

    def spoil(self, data: bytes) -> bytes:
        whose = [decode_value(frame) for frame in FrameDecoder().feed(data)]
        return encode_value(Id.ROBOT_ID, 1) if (Id.ROBOT_ID, 1) in whose else b""


class Echo(Robot):
    """Transmit and receive line touch."""

    def run(self) -> None:
        while not self.stopping.is_set():
            for master in select.select(self.masters, [], [], 0.01)[0]:
                self.write(master, os.read(master, 4096))


class Flood(Robot):
    """Sends without end, and ends no frame."""

    def run(self) -> None:
        while not self.stopping.is_set():
            if select.select([], self.masters, [], 0.01)[1]:
                self.write(self.masters[0], b"#bD?" * 1000)


class Liar(Robot):
    """Sends well-formed frames with random content."""

    def run(self) -> None:
        generator = random.Random(5)
        while not self.stopping.is_set():
            if select.select([], self.masters, [], 0.01)[1]:
                id = generator.choice((Id.TIME, Id.ROBOT_ID, Id.FIRMWARE_REVISION, -1, 99))
                value = generator.randrange(-32768, 32768)
                self.write(self.masters[0], encode_value(id, value))
                self.write(self.masters[0], encode_data(generator.randbytes(20)))
                self.write(self.masters[0], encode_mirrored(range(10)))


class Unplugged(Robot):
    """Is unplugged at the first message."""

    def spoil(self, data: bytes) -> bytes:
        if self.heard:
            self.stopping.set()
            self.hang_up()
            raise BlockingIOError
        return data


@pytest.fixture
def lab() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def start(lab: ExitStack, robot: Robot) -> Robot:
    robot.start()
    lab.callback(robot.close)
    return robot


def look(*paths: str, limit_s: float = 10.0) -> list[Device]:
    return discover(paths, robot_id=1, firmware=1, limit_s=limit_s)


# ---------------------------------------------------------------- found
def test_two_ports_of_one_microcontroller_are_found_and_known_to_be_one(lab: ExitStack) -> None:
    robot = start(lab, Robot())
    devices = look(*robot.paths)
    assert [device.finding for device in devices] == [Finding.FOUND] * 2
    assert [(device.robot_id, device.firmware) for device in devices] == [(1, 1)] * 2
    assert devices[0].line == f"{robot.paths[0]}: robot 1, firmware 1"
    assert devices[1].is_of(devices[0])
    assert choose_ports(devices, 1, 1) == robot.paths


def test_two_microcontrollers_of_one_id_are_told_apart_by_their_clocks(lab: ExitStack) -> None:
    one, other = start(lab, Robot()), start(lab, Robot(age_ms=7_000))
    devices = look(one.paths[0], other.paths[0], one.paths[1], other.paths[1])
    groups = [[device.path for device in group] for group in controllers(devices)]
    assert groups == [one.paths, other.paths]
    with pytest.raises(LinkError, match=r"2 microcontrollers call themselves robot 1: .*--serial"):
        choose_ports(devices, 1, 1)


def test_one_port_is_enough(lab: ExitStack) -> None:
    robot = start(lab, Robot(ports=1))
    assert choose_ports(look(*robot.paths), 1, 1) == robot.paths


# ---------------------------------------------------------------- not found, and why
def test_everything_else_is_one_clear_line(lab: ExitStack, tmp_path: Path) -> None:
    taken = start(lab, Robot(ports=1))
    held = SerialPort(taken.paths[0])
    lab.callback(held.close)
    (tmp_path / "file").write_text("")
    cases = {
        start(lab, Robot(1, robot_id=7)): (Finding.OTHER_ROBOT, "robot 7, firmware 1; expected is"),
        start(lab, Robot(1, revision=3)): (
            Finding.OTHER_FIRMWARE,
            "expected is firmware 1: install",
        ),
        start(lab, Mute(1)): (Finding.SILENT, "silent for 1.0 s; is the microcontroller switched"),
        start(lab, Slow(1)): (Finding.GARBAGE, "its baud rate is not 115200"),
        start(lab, Deaf(1)): (Finding.DEAF, "sends frames but did not answer"),
        start(lab, Forgetful(1)): (Finding.DEAF, "stopped answering after robot_id 1;"),
        start(lab, Echo(1)): (Finding.ECHO, "gives back what is sent"),
        start(lab, Flood(1)): (Finding.GARBAGE, "bytes with 0 whole frames"),
        start(lab, Unplugged(1)): (Finding.UNPLUGGED, "plug it in"),
        taken: (Finding.BUSY, "busy: another program has it open"),
        tmp_path / "file": (Finding.NOT_SERIAL, "not a serial device"),
        tmp_path / "none": (Finding.MISSING, "No such file or directory; plug it in"),
    }
    paths = [case.paths[0] if isinstance(case, Robot) else str(case) for case in cases]
    devices = look(*paths, limit_s=1.0)
    for device, (finding, text) in zip(devices, cases.values(), strict=True):
        assert (device.finding, text in device.text) == (finding, True), device
        assert "\n" not in device.line
    with pytest.raises(LinkError, match=r"no microcontroller of robot 1 .* 12 serial devices; "):
        choose_ports(devices, 1, 1)


def test_where_motors_run_nothing_is_sent(lab: ExitStack) -> None:
    robot = Robot()
    robot.firmware.receive(0, encode_set((90, 90, 90, 90), Id.MOTOR_STATE, MotorState.ON))
    start(lab, robot)
    (device,) = look(robot.paths[1])
    assert (device.finding, robot.heard) == (Finding.RUNNING, b"")
    assert "its motors are running" in device.text


def test_lies_are_told_in_one_line_too(lab: ExitStack) -> None:
    (device,) = look(start(lab, Liar(1)).paths[0], limit_s=2.0)
    assert device.finding is not Finding.FOUND
    assert "\n" not in device.line


def test_it_asks_with_all_four_command_bytes_zero(lab: ExitStack) -> None:
    robot = start(lab, Robot())
    look(*robot.paths)
    frames = FrameDecoder().feed(robot.heard)
    assert frames
    assert all(frame.command == ord("u") and frame.payload[:4] == bytes(4) for frame in frames)


# ---------------------------------------------------------------- waiting and choosing
def test_a_device_that_appears_is_found(lab: ExitStack, tmp_path: Path) -> None:
    robot = start(lab, Robot(ports=1))
    link = tmp_path / "mcu0"
    said: list[str] = []

    def say(line: str) -> None:
        said.append(line)
        link.symlink_to(robot.paths[0])

    (device,) = await_devices([str(link)], robot_id=1, firmware=1, patience_s=10.0, say=say)
    assert device.finding is Finding.FOUND
    assert len(said) == 1
    assert said[0].endswith("looks; trying for 10 s")


def test_what_waiting_cannot_mend_is_not_waited_for(lab: ExitStack) -> None:
    robot = start(lab, Robot(1, robot_id=7))
    (device,) = await_devices(robot.paths, robot_id=1, firmware=1, patience_s=1e9, say=pytest.fail)
    assert device.finding is Finding.OTHER_ROBOT


def test_candidates_are_each_device_once(
    lab: ExitStack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = start(lab, Robot())
    for index, path in enumerate(robot.paths):
        (tmp_path / f"mcu{index}").symlink_to(path)
    listed = [type("Port", (), {"device": path}) for path in (*robot.paths, "/dev/other")]
    monkeypatch.setattr(list_ports, "comports", lambda: listed)
    links = [str(tmp_path / "mcu0"), str(tmp_path / "mcu1")]
    assert candidates([str(tmp_path / "mcu*"), "/nowhere"]) == [*links, "/nowhere", "/dev/other"]
    assert find_ports([str(tmp_path / "mcu*")], robot_id=1, firmware=1) == links


def test_when_none_fits_every_device_is_told(
    lab: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = start(lab, Robot(robot_id=7))
    monkeypatch.setattr(list_ports, "comports", list)
    said: list[str] = []
    with pytest.raises(LinkError, match="no microcontroller of robot 1 with firmware 1"):
        find_ports(robot.paths, robot_id=1, firmware=1, patience_s=0.0, say=said.append)
    assert [line.split(";")[0] for line in said] == [
        f"{path}: robot 7, firmware 1" for path in robot.paths
    ]
    assert all("or fly this one with --robot-id 7" in line for line in said)


# ---------------------------------------------------------------- clocks
def test_a_clock_is_bounded_by_the_best_of_its_answers() -> None:
    clock = Clock().updated(5_000, 10.0, 10.1).updated(5_200, 10.2, 10.21)
    assert clock.low == pytest.approx(-5_010)
    assert clock.high == pytest.approx(-5_000 + STALE_MS)
    stalled = clock.updated(5_200, 10.6, 10.61)  # 0.4 s old: no information about the clock
    assert stalled == clock
    assert clock.agrees(clock)


def test_clocks_agree_through_the_wrap_at_60_s() -> None:
    before = Clock().updated(59_990, 10.0, 10.005)
    after = before.updated(5, 10.02, 10.025)
    assert after.high - after.low <= STALE_MS + 10.0
    assert Clock().updated(5, 10.02, 10.025).agrees(before)
    assert before.agrees(Clock().updated(5, 10.02, 10.025))
    assert not before.agrees(Clock().updated(105, 10.02, 10.025))
