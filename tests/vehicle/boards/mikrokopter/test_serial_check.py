"""`--check` against the simulator's devices: figures for a good line, one message for a fault."""

from __future__ import annotations

import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from vehicle.boards.mikrokopter import serial_check
from vehicle.boards.mikrokopter.serial_check import check_connection
from vehicle.realtime import RealTime
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.process import run
from vehicle.simulator.pseudo_terminal import PseudoTerminal
from vehicle_link.serial.discovery import Clock, Device, Finding

BOUND = 30.0
"""Time, in s, after which a waiting test fails."""
REFUSED = RealTime(False, False, "not real time: SCHED_FIFO 50 refused")


class Simulator(threading.Thread):
    """`quadlab simulator` in a thread."""

    def __init__(self, folder: Path, parameters: SimulatorParameters | None = None) -> None:
        super().__init__(daemon=True)
        self._parameters = parameters or SimulatorParameters()
        self.paths = [str(folder / "mcu0"), str(folder / "mcu1")]
        self._folder = folder
        self._stop_asked = threading.Event()

    def run(self) -> None:
        run(self._parameters, self._folder, None, stop=self._stop_asked)

    def end(self) -> None:
        self._stop_asked.set()
        self.join(BOUND)


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[Simulator]:
    thread = Simulator(tmp_path)
    thread.start()
    yield thread
    thread.end()


def check(paths: list[str], patience_s: float = BOUND) -> tuple[bool, list[str]]:
    said: list[str] = []
    good = check_connection(
        paths, patience_s=patience_s, say=said.append, ask_for_real_time=lambda: REFUSED
    )
    assert not any("\n" in line for line in said)
    return good, said


def test_a_good_connection_is_measured_and_told(simulator: Simulator) -> None:
    good, said = check(simulator.paths)
    one, other = simulator.paths
    assert good, said
    text = "\n".join(line for line in said if "trying for" not in line)
    assert text.startswith(
        f"{one}: robot 1, firmware 1\n{other}: robot 1, firmware 1, the same as {one}\nbattery 16."
    )
    rates = re.search(rf"(\d+) on {one}, (\d+) on {other}; (\d+) together", text)
    assert rates is not None
    assert min(map(int, rates.groups())) > 0
    assert "damaged frames: 0 of " in text
    assert "motor controllers: all four answer" in text
    assert re.search(r"round trip of a request: [\d.]+ ms p50, [\d.]+ ms at most; \d+ of", text)
    gyroscope = re.search(r"mean (.+), (.+), (.+) °/s, deviation (.+) °/s$", text, re.MULTILINE)
    assert gyroscope is not None
    x, y, z, deviation = map(float, gyroscope.groups())
    assert (x, y, z) == pytest.approx((0.9, -0.7, 0.5), abs=0.2)  # the simulated drift
    assert 0.2 < deviation < 0.6
    assert text.endswith(f"{REFUSED.refusal}\ngood")


def test_a_motor_whose_controller_is_silent_is_named(tmp_path: Path) -> None:
    simulator = Simulator(tmp_path, SimulatorParameters(missing_motor=3))
    simulator.start()
    good, said = check(simulator.paths)
    simulator.end()
    assert not good
    line = "not good: no answer from the controller of motor rear on the motors' bus; check plug"
    assert any(one.startswith(line) for one in said), said


def test_a_port_that_stops_meanwhile_is_one_line(simulator: Simulator) -> None:
    said: list[str] = []

    def unplug() -> RealTime:
        simulator.end()
        return REFUSED

    assert not check_connection(simulator.paths, say=said.append, ask_for_real_time=unplug)
    assert said[-1].startswith(f"not good: serial port {simulator.paths[0]} cannot be opened")


def test_damaged_frames_are_counted_and_not_good(
    simulator: Simulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, count = PseudoTerminal.write, 0

    def noisy(terminal: PseudoTerminal, data: bytes) -> None:
        nonlocal count
        count += 1
        write(terminal, data if count % 20 else data.replace(b"b", b"\xff", 1))

    monkeypatch.setattr(PseudoTerminal, "write", noisy)
    good, said = check(simulator.paths)
    assert not good
    told = r"not good: \d+ of \d+ frames damaged, allowed is 1 %; check"
    assert any(re.match(told, line) for line in said), said


def test_a_device_that_is_not_there_is_waited_for_then_told(tmp_path: Path) -> None:
    good, said = check([str(tmp_path / "mcu0")], patience_s=0.0)
    assert not good
    assert [line.startswith("not good: ") for line in said] == [True]


def test_ports_of_two_microcontrollers_are_not_flown_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = [
        Device(path, Finding.FOUND, "robot 1, firmware 1", 1, 1, Clock(low, low + 30))
        for path, low in (("a", 0.0), ("b", 5_000.0))
    ]
    monkeypatch.setattr(serial_check, "await_devices", lambda *arguments, **options: found)
    good, said = check(["a", "b"])
    assert not good
    assert said[-1].startswith("not good: a and b are two microcontrollers of one robot id")


def test_the_command_ends_with_status_0_and_the_word_good(simulator: Simulator) -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "quadlab",
            "vehicle",
            "--check",
            "--serial",
            ",".join(simulator.paths),
        ],
        capture_output=True,
        text=True,
        timeout=BOUND,
        check=False,
    )
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "good"), done.stderr
    assert "real time" in done.stdout
