"""`--check` of a Crazyflie: what must change, and one that does not answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from extensions.crazyflie.board import check
from extensions.crazyflie.board.arming import why_not_armed
from extensions.crazyflie.board.check import check_board
from extensions.crazyflie.board.messages import Info
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.tests.board.bench import RestingCrazyflie
from quadrotor.errors import LinkError
from vehicle_link import clock
from vehicle_link.serial.port import MemoryPort

Checked = Callable[..., tuple[list[str], list[str]]]


class Stepped(MemoryPort):
    """A port behind which the Crazyflie runs a millisecond with each look."""

    def __init__(self, firmware: RestingCrazyflie | None) -> None:
        super().__init__()
        self.firmware, self.now_ms = firmware, 0

    def read(self) -> bytes:
        self.now_ms += 1
        if self.firmware is None:
            return b""
        self.firmware.period((0, 0, 0, 0))
        return self.firmware.next_data()[1]

    def write(self, data: bytes) -> None:
        if self.firmware is not None:
            self.firmware.receive(0, data)


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch) -> Checked:
    def run(
        firmware: RestingCrazyflie | None, options: CrazyflieOptions | None = None
    ) -> tuple[list[str], list[str]]:
        port = Stepped(firmware)
        said: list[str] = []
        monkeypatch.setattr(check, "POLL_S", 0.0)
        monkeypatch.setattr(clock, "monotonic", lambda: 1e-3 * port.now_ms)
        lines = check_board(port, options or CrazyflieOptions(), said.append)
        return lines, said

    return run


def test_it_tells_what_is_there_and_what_each_start_sets_and_sets_nothing(checked: Checked) -> None:
    firmware = RestingCrazyflie()
    lines, said = checked(firmware)
    assert lines == []
    assert said == [
        "CF2.1, firmware quadlab simulation",
        "battery 4.10 V",
        "shown on the Gains tab: board.firmware.stabilizer.controller, "
        "board.firmware.stabilizer.estimator",
        "each start sets stabilizer.estimator = 2  # it is 0",
        "good",
    ]
    assert firmware.parameters.values["stabilizer.estimator"] == 0
    assert not [packet for packet in firmware.taken if packet.port in (7, 9)]


def test_a_firmware_that_is_too_old_must_change(checked: Checked) -> None:
    lines, said = checked(RestingCrazyflie(protocol=11))
    [line] = lines
    assert line.startswith("the Crazyflie speaks CRTP 11, older than 12")
    assert said == [f"not good: {line}"]


@pytest.mark.parametrize(
    ("info", "distance", "why"),
    [
        (Info.CAN_ARM | Info.LOCKED, 0.0, "is locked after an emergency stop: switch it off"),
        (Info.CAN_ARM | Info.TUMBLED, 0.0, "is turned over or has crashed: set it down level"),
        (Info.CAN_ARM | Info.CRASHED, 0.0, "is turned over or has crashed: set it down level"),
        (Info.CAN_FLY, 0.0, "the Crazyflie's own checks do not pass: see its console"),
        (Info.CAN_ARM, 0.6, "its own estimate is 0.6 m from ours: wait, or check"),
    ],
)
def test_each_reason_not_to_arm_it_has_its_line(info: Info, distance: float, why: str) -> None:
    assert why in why_not_armed(info, distance)
    assert (
        why_not_armed(Info.CAN_ARM, 0.4) == why_not_armed(Info.AUTO_ARMED | Info.ARMED, 0.0) == ""
    )


def test_nobody_there_and_one_in_the_air_are_told(checked: Checked) -> None:
    with pytest.raises(LinkError, match="no answer from it within 2 s: is it switched on"):
        checked(None)
    firmware = RestingCrazyflie()
    firmware.supervisor.arm(True)
    firmware._thrust, firmware._setpoint_ms = 30_000, 10_000
    with pytest.raises(LinkError, match="it is flying, and is checked once it has landed"):
        checked(firmware)
