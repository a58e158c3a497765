"""Each setting that does not fit is one line for the command line; a board that fits has none."""

from __future__ import annotations

import pytest

from extensions.betaflight.board import check
from extensions.betaflight.board.arming import REASONS, why_not_armed
from extensions.betaflight.board.configuration import MAY_LACK, lines_to_enter, mode_lines, required
from extensions.betaflight.board.options import BetaflightOptions
from extensions.crazyflie.crtp.packets import Packet, frame
from quadrotor.errors import LinkError

OPTIONS = BetaflightOptions()


def fitting() -> dict[str, str]:
    return required(OPTIONS)


def written(settings: dict[str, str], lines: list[str]) -> str:
    return "\r\n".join([*(f"set {name} = {value}" for name, value in settings.items()), *lines, ""])


class Chatter:
    """Port of something that speaks, but no MSP."""

    def __init__(self, said: bytes) -> None:
        self._said = said

    def read(self) -> bytes:
        return self._said

    def write(self, data: bytes) -> None: ...

    def fileno(self) -> int:
        return -1

    def close(self) -> None: ...


@pytest.mark.parametrize(
    "said",
    [b"#bDfly>=FtOwly===q=U||q=Mm=XMI=fs\r", frame(Packet(5, 2, bytes(28)).encode()), b"$M>\xff"],
)
def test_another_board_behind_the_port_is_told_in_one_line(
    said: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check, "ANSWER_S", 0.02)
    monkeypatch.setattr(check, "RESTART_S", 0.02)
    with pytest.raises(LinkError, match=r"no answer to MSP VARIANT within .* is this the port"):
        check.check_board(Chatter(said), BetaflightOptions(), print)


def test_a_board_that_fits_needs_no_line() -> None:
    assert lines_to_enter(written(fitting(), mode_lines()), OPTIONS) == []


def test_each_wrong_setting_is_one_line_and_save_comes_last() -> None:
    for name, value in fitting().items():
        answer = written(fitting() | {name: "7"}, mode_lines())
        assert lines_to_enter(answer, OPTIONS) == [f"set {name} = {value}  # it was 7", "save"]


def test_only_what_a_build_may_lack_may_be_missing() -> None:
    for name, value in fitting().items():
        there = {other: its for other, its in fitting().items() if other != name}
        line = f"set {name} = {value}  # it was not there"
        lines = [] if name in MAY_LACK else [line, "save"]
        assert lines_to_enter(written(there, mode_lines()), OPTIONS) == lines


def test_options_change_what_is_asked_for() -> None:
    options = BetaflightOptions(rate_max=600.0, failsafe_delay=0.1)
    lines = lines_to_enter(written(fitting(), mode_lines()), options)
    assert "set roll_rc_rate = 60  # it was 40" in lines
    assert "set failsafe_delay = 1  # it was 2" in lines


def test_the_angle_loop_is_compared_where_it_is_flown() -> None:
    options = BetaflightOptions(level="angles", angle_gain=6.0)
    assert lines_to_enter(written(fitting(), mode_lines()), options) == [
        "set angle_p_gain = 60  # it was not there",
        "set angle_feedforward = 0  # it was not there",
        "set angle_earth_ref = 0  # it was not there",
        "save",
    ]


@pytest.mark.parametrize(
    "modes",
    [
        mode_lines()[:2],
        [*mode_lines(), "aux 3 0 5 900 1300 0 0"],
        [*mode_lines()[:2], "aux 2 27 2 1300 1700 0 0"],
    ],
)
def test_modes_missing_moved_or_on_a_second_switch_are_told(modes: list[str]) -> None:
    assert lines_to_enter(written(fitting(), modes), OPTIONS) == [*mode_lines(), "save"]


def test_every_reason_has_a_sentence_with_its_name() -> None:
    assert len({name for name, _ in REASONS}) == 30
    for bit, (name, why) in enumerate(REASONS):
        assert why_not_armed(1 << bit) == f"{name}: {why}"
    assert why_not_armed(0) == ""


def test_older_versions_know_fewer_reasons_and_end_with_the_same() -> None:
    assert why_not_armed(1 << 28, 29).startswith("ARM_SWITCH: ")  # 4.6
    assert why_not_armed(1 << 27, 29).startswith("POS_HOLD_SW: ")


def test_the_consequence_is_told_only_alone_and_unknown_bits_are_named() -> None:
    assert "ARM_SWITCH" not in why_not_armed(1 << 29 | 1 << 2)
    assert why_not_armed(1 << 29).startswith("ARM_SWITCH: ")
    assert "unknown reason 0x40000000" in why_not_armed(1 << 30)
