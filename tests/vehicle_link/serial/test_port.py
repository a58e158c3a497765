"""Ports never wait: memory pairs, and a serial device made of a pseudo-terminal."""

from __future__ import annotations

import grp
import os
import select
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from quadrotor.errors import LinkError
from vehicle_link.serial.port import PortError, PortProblem, memory_port_pair
from vehicle_link.serial.serial_port import SerialPort


class Terminal:
    """Pseudo-terminal whose master side the test has."""

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
    with pytest.raises(LinkError, match="busy: another program has it open"):
        SerialPort(terminal.path)
    port.close()


def test_a_missing_device_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"mcu0 cannot be opened: No such file.*--find") as caught:
        SerialPort(tmp_path / "mcu0")
    assert "\n" not in str(caught.value)


def test_what_is_no_serial_device_is_said_to_be_none(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path, Path("/dev/null")):
        with pytest.raises(PortError, match="not a serial device") as caught:
            SerialPort(path)
        assert caught.value.problem is PortProblem.NOT_SERIAL


def test_a_device_of_others_names_the_group_to_join(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object) -> int:
        raise PermissionError(13, "Permission denied")

    os.chmod(terminal.path, 0o660)
    with monkeypatch.context() as patch:  # root, who may run the tests, is never refused
        patch.setattr(os, "open", refuse)
        patch.setattr(grp, "getgrgid", lambda _: type("Group", (), {"gr_name": "dialout"}))
        with pytest.raises(PortError, match="usermod -aG dialout ") as caught:
            SerialPort(terminal.path)
        assert caught.value.problem is PortProblem.FORBIDDEN
        os.chmod(terminal.path, 0o600)  # no group may open it
        with pytest.raises(PortError, match=f"`sudo chmod a\\+rw {terminal.path}`"):
            SerialPort(terminal.path)


def test_a_device_that_floods_does_not_keep_the_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = os.openpty()
    port = SerialPort(os.ttyname(slave))
    with monkeypatch.context() as patch:
        patch.setattr(os, "read", lambda descriptor, size: bytes(size))
        assert len(port.read()) == 65_536
    port.close()
    os.close(master)
    os.close(slave)
