"""The real Betaflight as the judge: its messages, its command line and its settings.

The firmware is a process of its own whose time is stepped, so that a busy machine changes nothing.
`scripts/betaflight` builds it; without it the tests are skipped.
"""

from __future__ import annotations

import pytest

from quadrotor.errors import LinkError
from quadrotor.vehicle_model import Four
from vehicle.boards.betaflight.board import BetaflightBoard
from vehicle.boards.betaflight.check import ENTER, check_board
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle.boards.board import RawSample
from vehicle.simulator.betaflight.process import FIRMWARE, REST, BetaflightProcess

pytestmark = pytest.mark.skipif(
    not FIRMWARE.exists(), reason="no Betaflight: scripts/betaflight builds it"
)
STEP_NS = 1_000_000


class SteppedPort:
    """The board's port, on which its time goes on whenever nothing has come yet."""

    def __init__(self, board: BetaflightProcess) -> None:
        self._board = board

    def read(self) -> bytes:
        if data := self._board.port.read():
            return data
        self._board.step(5 * STEP_NS, *REST)
        return self._board.port.read()

    def write(self, data: bytes) -> None:
        self._board.port.write(data)

    def fileno(self) -> int:
        return self._board.port.fileno()

    def close(self) -> None: ...


def test_the_lines_of_the_check_make_the_real_firmware_fit() -> None:
    said: list[str] = []
    board = BetaflightProcess()
    assert not check_board(SteppedPort(board), BetaflightOptions(), said.append)
    board.close()
    assert said[0] == "Betaflight 4.6.0"
    lines = said[said.index(ENTER) + 1 :]
    assert "set roll_rc_rate = 40" in lines
    board = BetaflightProcess(lines)
    assert check_board(SteppedPort(board), BetaflightOptions(), said.append)
    board.close()
    assert said[-1] == "good"


def test_a_line_that_the_firmware_refuses_is_told() -> None:
    with pytest.raises(LinkError, match="Betaflight refuses 'set roll_rc_rate = blue"):
        BetaflightProcess(["set roll_rc_rate = blue", "save"])


def told(board: BetaflightProcess) -> tuple[list[RawSample], list[Four]]:
    now_ns = 0
    stack = BetaflightBoard([board.port], BetaflightOptions(), rate=250, now_ns=lambda: now_ns)
    samples, motors = [], []
    for k in range(800):
        turning = (0.1 * (k % 7), -0.2, 0.3)
        motors.append(board.step(STEP_NS, turning, (0.5, -1.0, 9.81), (1.0, 0.0, 0.0, 0.0)))
        now_ns += STEP_NS
        samples += stack.receive()
        stack.service(1e-9 * now_ns)
    return samples, motors


def test_the_same_states_and_bytes_give_the_same_answers_in_our_axes() -> None:
    boards = BetaflightProcess(), BetaflightProcess()
    first, second = (told(board) for board in boards)
    for board in boards:
        board.close()
    assert first == second
    newest = first[0][-1]
    assert newest.gyroscope[1] / 16.384 == pytest.approx(-11.46, abs=0.2)  # deg/s
    assert newest.gyroscope[2] / 16.384 == pytest.approx(17.19, abs=0.2)
    assert newest.accelerometer == pytest.approx((13, -26, 256), abs=1)  # 256 a g
    assert len(first[0]) > 30  # at 100 Hz, its own setting until it is set up


def test_a_board_that_has_ended_turns_no_motor() -> None:
    board = BetaflightProcess()
    board.kill()
    assert board.step(STEP_NS, *REST) == (0.0, 0.0, 0.0, 0.0)
    board.close()
