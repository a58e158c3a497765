"""The flight process arms no board that does not fit, and waits for one that still flies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from quadrotor.errors import LinkError
from quadrotor.parameters import Parameters
from vehicle.flight import process
from vehicle.flight.process import why_unfit
from vehicle_link.serial.port import MemoryPort, Port, memory_port_pair

Say = Callable[[str], None]


@pytest.fixture
def port() -> MemoryPort:
    return memory_port_pair()[0]


def answering(*lines: str) -> Any:
    return lambda port, options, say: list(lines)


def test_a_board_that_fits_may_be_armed(port: MemoryPort) -> None:
    assert why_unfit(port, None, answering()) == ""


def test_each_misfit_is_named_and_what_to_do(port: MemoryPort) -> None:
    why = why_unfit(port, None, answering("set a = 1", "set b = 2", "set c = 3", "save"))
    assert why.startswith("the board's settings do not fit: set a = 1; set b = 2; set c = 3")
    assert "and 1 more" in why
    assert "--check" in why


def test_a_board_that_still_flies_is_waited_for_and_told_once(
    port: MemoryPort, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(process, "CHECK_AGAIN_S", 0.0)
    tries = iter(["it is armed", "it is armed", ""])

    def check(port: Port, options: Parameters | None, say: Say) -> list[str]:
        if why := next(tries):
            raise LinkError(why)
        return []

    assert why_unfit(port, None, check) == ""
    assert capfd.readouterr().err.count("waiting for the board: it is armed") == 1
