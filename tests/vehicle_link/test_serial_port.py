"""Ports never wait: memory pairs, and a serial device made of a pseudo-terminal."""

from __future__ import annotations

import os
import select
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from quadrotor.errors import LinkError
from vehicle_link.serial.port import SerialPort, memory_port_pair


class Terminal:
    """A pseudo-terminal whose master side the test holds."""

    def __init__(self) -> None:
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)

    def hang_up(self) -> None:
        os.close(self._slave)
        os.close(self.master)
        self.master = -1


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    terminal = Terminal()
    yield terminal
    if terminal.master >= 0:
        terminal.hang_up()


def wait_for(port: SerialPort) -> None:
    assert select.select([port], [], [], 5.0)[0], "nothing arrived in 5 s"


def test_memory_ports_carry_bytes_both_ways_once() -> None:
    one, other = memory_port_pair()
    one.write(b"ab")
    one.write(b"c")
    other.write(b"x")
    assert (other.read(), other.read(), one.read()) == (b"abc", b"", b"x")


def test_a_memory_port_nobody_reads_drops_and_counts() -> None:
    one, other = memory_port_pair()
    for _ in range(200):
        one.write(bytes(34))
    assert len(other.read()) == 4080
    assert one.dropped == 80


def test_a_memory_port_has_no_file() -> None:
    with pytest.raises(LinkError, match="no file to poll"):
        memory_port_pair()[0].fileno()


def test_a_serial_port_reads_what_is_there_and_never_waits(terminal: Terminal) -> None:
    port = SerialPort(terminal.path)
    assert port.read() == b""
    os.write(terminal.master, b"#\x00\xff\r\n")
    wait_for(port)
    assert port.read() == b"#\x00\xff\r\n"  # raw: the terminal changes no byte
    assert port.read() == b""
    port.write(b"back\r")
    assert os.read(terminal.master, 100) == b"back\r"
    port.close()


def test_opening_discards_what_waited(terminal: Terminal) -> None:
    os.write(terminal.master, b"old")
    port = SerialPort(terminal.path)
    os.write(terminal.master, b"new")
    wait_for(port)
    assert port.read() == b"new"
    port.close()


def test_a_line_nobody_reads_drops_and_counts(terminal: Terminal) -> None:
    port = SerialPort(terminal.path)
    for _ in range(20_000):
        port.write(bytes(14))
        if port.dropped:
            break
    assert port.dropped == 1
    port.close()


def test_a_line_that_hangs_up_is_an_error(terminal: Terminal) -> None:
    port = SerialPort(terminal.path)
    terminal.hang_up()
    with pytest.raises(LinkError, match=r"is gone: .*start the vehicle again"):
        port.read()
    port.close()


def test_a_port_opens_once(terminal: Terminal) -> None:
    port = SerialPort(terminal.path)
    with pytest.raises(LinkError, match="the port free"):
        SerialPort(terminal.path)
    port.close()


def test_a_missing_device_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"cannot open serial port .*No such file") as caught:
        SerialPort(tmp_path / "mcu0")
    assert "\n" not in str(caught.value)
