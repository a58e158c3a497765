"""Serial line at its rate, against a real pseudo-terminal."""

from __future__ import annotations

import os
import select
from collections.abc import Iterator
from pathlib import Path

import pytest

from vehicle.simulator.pseudo_terminal import PseudoTerminal
from vehicle.simulator.uart import BUFFER, BYTES_PER_SECOND, Uart
from vehicle_link.serial.serial_port import SerialPort

MS = 0.001
FRAME = b"#" + b"x" * 32 + b"\r"


@pytest.fixture
def line(tmp_path: Path) -> Iterator[tuple[Uart, SerialPort]]:
    uart = Uart(PseudoTerminal(tmp_path / "mcu0"))
    host = SerialPort(tmp_path / "mcu0")
    yield uart, host
    host.close()
    uart.close()


def test_a_frame_arrives_when_its_last_byte_does(line: tuple[Uart, SerialPort]) -> None:
    uart, host = line
    uart.write(FRAME)
    for _ in range(2):
        uart.advance(MS)
        assert host.read() == b""
    uart.advance(MS)  # 34 B take 2.95 ms
    assert host.read() == FRAME


def test_both_ways_carry_11520_bytes_a_second(line: tuple[Uart, SerialPort]) -> None:
    uart, host = line
    out = back = b""
    waiting = bytearray(bytes(range(256)) * 60)
    for k in range(1000):
        if k % 2 == 0:  # 17 kB/s offered
            uart.write(FRAME)
        host.write(bytes(waiting[:20]))  # 20 kB/s offered
        del waiting[:20]
        assert select.select([uart], [], [], 10.0)[0]  # the kernel delivers them when it can
        uart.advance(MS)
        out += host.read()
        back += uart.read()
    assert len(out) == pytest.approx(BYTES_PER_SECOND, abs=40)
    assert uart.overruns == pytest.approx(17_000 - BYTES_PER_SECOND - BUFFER, abs=80)
    assert len(back) == pytest.approx(BYTES_PER_SECOND, abs=12)
    assert back == (bytes(range(256)) * 60)[: len(back)]


def test_what_does_not_fit_the_controller_s_ring_is_lost_and_counted(
    line: tuple[Uart, SerialPort],
) -> None:
    uart, host = line
    for _ in range(10):
        uart.write(FRAME)
    assert uart.overruns == 10 * len(FRAME) - BUFFER
    got = b""
    for _ in range(40):
        uart.advance(MS)
        got += host.read()
    assert got == (FRAME * 10)[:BUFFER]


def test_an_idle_line_saves_nothing_up(line: tuple[Uart, SerialPort]) -> None:
    uart, host = line
    for _ in range(1000):
        uart.advance(MS)
    host.write(FRAME)
    uart.write(FRAME)
    uart.advance(MS)
    assert len(uart.read()) <= 13
    assert host.read() == b""


def test_noise_without_an_end_gets_through_too(line: tuple[Uart, SerialPort]) -> None:
    uart, host = line
    uart.write(os.urandom(30).replace(b"\r", b"."))
    got = b""
    for _ in range(5):
        uart.advance(MS)
        got += host.read()
    assert len(got) == 30
