"""`quadlab vehicle --serial … --check --find`: the words, and a line for each mistake."""

from __future__ import annotations

from pathlib import Path

import pytest
from serial.tools import list_ports

from quadlab.__main__ import main
from quadlab.serial_ports import flight_ports, split_ports
from quadrotor.errors import UsageError


@pytest.mark.parametrize(
    "words", [["/dev/a,/dev/b"], ["/dev/a", "/dev/b"], ["/dev/a,", "/dev/b"], ["/dev/a, /dev/b"]]
)
def test_ports_are_separated_by_commas_or_blanks(words: list[str]) -> None:
    assert flight_ports(words) == ["/dev/a", "/dev/b"]


def test_a_device_with_a_comma_in_its_name_is_one(tmp_path: Path) -> None:
    device = tmp_path / "a,b"
    device.write_text("")
    assert split_ports([str(device)]) == [str(device)]


@pytest.mark.parametrize("words", [[], [","], ["a,b,c"], ["a", "b", "c"]])
def test_one_or_two_ports_are_needed(words: list[str]) -> None:
    with pytest.raises(UsageError, match=r"--serial has \d ports; allowed are one or two.*--find"):
        flight_ports(words)


def test_one_device_under_two_names_is_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "device")
    with pytest.raises(UsageError, match="is one device twice"):
        flight_ports([str(tmp_path / "link"), str(tmp_path / "device")])


@pytest.mark.parametrize("word", ["--check", "--name=quad1"])
def test_without_a_port_the_command_says_what_to_give(
    word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["vehicle", word]) == 2
    said = capsys.readouterr().err
    assert "--serial /dev/ttyUSB0,/dev/ttyUSB1, or --serial auto" in said
    assert said.count("\n") == 1


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
