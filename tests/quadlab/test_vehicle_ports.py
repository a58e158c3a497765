"""`quadlab vehicle --serial … --check --find`: its output, and a line for each mistake."""

from __future__ import annotations

import os
import select
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
from serial.tools import list_ports

from quadlab.__main__ import main
from quadlab.up.serial_ports import flight_ports, ports_at_rate, split_ports
from quadrotor.errors import UsageError
from vehicle.simulator.firmware.firmware import Firmware
from vehicle_link.serial.ids import Id


@pytest.mark.parametrize(
    "words", [["/dev/a,/dev/b"], ["/dev/a", "/dev/b"], ["/dev/a,", "/dev/b"], ["/dev/a, /dev/b"]]
)
def test_ports_are_separated_by_commas_or_blanks(words: list[str]) -> None:
    assert flight_ports(words) == ["/dev/a", "/dev/b"]


def test_a_device_with_a_comma_in_its_name_is_one(tmp_path: Path) -> None:
    device = tmp_path / "a,b"
    device.write_text("")
    assert split_ports([str(device)]) == [str(device)]


def test_a_path_counts_from_where_the_command_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert flight_ports(["run/mcu0", "/dev/b"]) == [f"{tmp_path}/run/mcu0", "/dev/b"]


@pytest.mark.parametrize("words", [[], [","], ["a,b,c"], ["a", "b", "c"]])
def test_one_or_two_ports_are_needed(words: list[str]) -> None:
    with pytest.raises(UsageError, match=r"--serial has \d ports; allowed are one or two.*--find"):
        flight_ports(words)


def test_one_device_under_two_names_is_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "device")
    with pytest.raises(UsageError, match="is one device twice"):
        flight_ports([str(tmp_path / "link"), str(tmp_path / "device")])


def test_find_tells_each_device_and_ends_with_1_when_none_fits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = [type("Port", (), {"device": "/dev/null"})]
    monkeypatch.setattr(list_ports, "comports", lambda: listed)
    assert main(["vehicle", "--find", "--serial", str(tmp_path / "none")]) == 1
    said = capsys.readouterr()
    first, second = said.out.splitlines()
    assert first.startswith(f"{tmp_path}/none: No such file or directory; plug it in")
    assert second.startswith("/dev/null: not a serial device")
    assert "no microcontroller of robot 1 with firmware 1 behind 2 serial devices" in said.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["vehicle", "--serial", "/dev/a", "--rate", "500"], "one serial port carries 338"),
        (["vehicle", "--serial", "/dev/a,/dev/b", "--rate", "700"], "2 serial ports carry 677"),
        (["vehicle", "--in-process", "--rate", "1001"], "allowed are 60 to 1000 Hz"),
        (["vehicle", "--in-process", "--serial", "/dev/a"], "leave one of the two out"),
        (["up", "--rate", "1000"], "2 serial ports carry 677"),
        (["vehicle", "--serial", "auto", "--rate", "1000"], "2 serial ports carry 677"),
        (["vehicle", "--check"], "--serial /dev/ttyUSB0,/dev/ttyUSB1, or --serial auto"),
        (["vehicle", "--name=quad1"], "--serial /dev/ttyUSB0,/dev/ttyUSB1, or --serial auto"),
        (
            ["vehicle", "--board=crazyflie", "--serial=/dev/a"],
            "is behind a link, like radio://0/80",
        ),
        (
            ["vehicle", "--board=crazyflie", "--serial=/dev/a", "--check"],
            "--serial /dev/a is a dev",
        ),
        (["vehicle", "--find", "--check"], "--find searches all devices, --check tests two"),
        (
            ["vehicle", "--find", "--robot-id=40000"],
            "--robot-id 40000 is not allowed; allowed are 0 to 32767",
        ),
        (
            ["vehicle", "--find", "--firmware=40000"],
            "--firmware 40000 is not allowed; allowed are 0 to 32767",
        ),
    ],
)
def test_what_cannot_be_meant_is_one_line_before_anything_starts(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    line = capsys.readouterr().err
    assert said in line
    assert line.count("\n") == 1


def test_in_process_there_are_no_ports() -> None:
    assert ports_at_rate([], 1000, in_process=True) == ([], 1000)
    assert ports_at_rate(["/dev/a"], 250, in_process=False) == (["/dev/a"], 250)


def test_without_a_rate_the_ports_decide() -> None:
    assert ports_at_rate(["/dev/a"], None, in_process=False) == (["/dev/a"], 300)
    assert ports_at_rate(["/dev/a", "/dev/b"], None, in_process=False)[1] == 500
    assert ports_at_rate([], None, in_process=True) == ([], 500)


@pytest.fixture
def robot_7() -> Iterator[str]:
    """Yield the device of a microcontroller, robot 7 with firmware 3, that answers requests."""
    firmware, stopping = Firmware(1), threading.Event()
    firmware.registers[Id.ROBOT_ID], firmware.registers[Id.FIRMWARE_REVISION] = 7, 3
    master, slave = os.openpty()
    tty.setraw(slave)

    def answer() -> None:
        while not stopping.is_set():
            if select.select([master], [], [], 0.01)[0]:
                os.write(master, firmware.receive(0, os.read(master, 4096)))

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    yield os.ttyname(slave)
    stopping.set()
    thread.join(10.0)
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize(
    ("options", "status", "told"),
    [
        (["--robot-id", "7", "--firmware", "3"], 0, "--robot-id 7 --firmware 3"),
        (["--firmware", "3"], 1, "expected is robot 1: give its ports, or fly this one with "),
        (["--robot-id=7"], 1, "expected is firmware 1: install that one, or fly with --firmware"),
    ],
)
def test_a_robot_is_found_by_the_id_and_firmware_that_are_asked_for(
    robot_7: str,
    options: list[str],
    status: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(list_ports, "comports", list)
    assert main(["vehicle", "--find", "--serial", robot_7, *options]) == status
    said = capsys.readouterr().out
    assert said.startswith(f"{robot_7}: robot 7, firmware 3")
    assert told in said


def test_a_file_is_no_port_to_fly_with_and_that_is_told_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["vehicle", "--serial", str(tmp_path / "file"), "--rate", "300"]) == 1
    said = capsys.readouterr().err
    assert f"serial port {tmp_path}/file cannot be opened: not a serial device" in said
    assert said.count("\n") == 1
