"""Real Betaflight as the judge: its messages, its command line and its settings.

The firmware is a separate process whose time is stepped, so that a busy machine changes nothing.
`scripts/betaflight` builds it.
"""

from __future__ import annotations

import pytest

from extensions.betaflight.board.board import RESTARTED, BetaflightBoard
from extensions.betaflight.board.check import BY_THROTTLE, ENTER, check_board
from extensions.betaflight.board.configuration import mode_lines, required
from extensions.betaflight.board.options import BetaflightOptions
from extensions.betaflight.simulated.process import REST, BetaflightProcess
from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from quadrotor.vehicle_model import Four
from vehicle.boards.board import RawSample

pytestmark = pytest.mark.needs("betaflight")
STEP_NS = 1_000_000


class SteppedPort:
    """Port of the board, whose time advances whenever no bytes are available."""

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
    lines = check_board(SteppedPort(board), BetaflightOptions(), said.append)
    board.close()
    assert said[0] == "Betaflight 4.6.0"
    assert BY_THROTTLE not in said
    assert said[said.index(ENTER) + 1 :] == lines
    assert "set roll_rc_rate = 40  # it was 7" in lines
    board = BetaflightProcess(lines)
    assert check_board(SteppedPort(board), BetaflightOptions(), said.append) == []
    assert said[-1] == "good"
    # The check has restarted it; with other options the same board does not fit.
    other = BetaflightOptions(level="angles", failsafe_delay=0.1, landing_throttle=1400)
    assert check_board(SteppedPort(board), other, said.append) == [
        "set angle_feedforward = 0  # it was 50",
        "set angle_earth_ref = 0  # it was 100",
        "set failsafe_delay = 1  # it was 2",
        "set failsafe_throttle = 1400  # it was 1470",
        "save",
    ]
    board.close()


class WithoutAltitudeHold(SteppedPort):
    """Board whose firmware was built for less memory."""

    def read(self) -> bytes:
        return super().read().replace(b"ap_hover_throttle", b"ap_hover_roll")


def test_a_board_that_lands_by_throttle_alone_is_told() -> None:
    said: list[str] = []
    settings = [f"set {name} = {value}" for name, value in required(BetaflightOptions()).items()]
    board = BetaflightProcess([*settings, *mode_lines(), "save"])
    assert check_board(WithoutAltitudeHold(board), BetaflightOptions(), said.append) == []
    board.close()
    assert BY_THROTTLE in said


class Lossy(SteppedPort):
    """Port that loses 300 bytes of a long answer, `losses` times, each time at another place."""

    def __init__(self, board: BetaflightProcess, losses: int) -> None:
        super().__init__(board)
        self.losses, self._seen = losses, 0

    def write(self, data: bytes) -> None:
        self._seen = 0
        super().write(data)

    def read(self) -> bytes:
        data = super().read()
        before, self._seen = self._seen, self._seen + len(data)
        middle = 6000 + 500 * self.losses
        if self.losses and before <= middle < self._seen:
            self.losses -= 1
            return data[: middle - before] + data[middle - before + 300 :]
        return data


def test_an_answer_that_lost_bytes_is_asked_for_again_and_never_judged() -> None:
    said: list[str] = []
    settings = [f"set {name} = {value}" for name, value in required(BetaflightOptions()).items()]
    board = BetaflightProcess([*settings, *mode_lines(), "save"])
    port = Lossy(board, 2)
    assert check_board(port, BetaflightOptions(), said.append) == []
    assert (port.losses, said[-1]) == (0, "good")
    assert not any(line.startswith("set ") for line in said)
    board.close()


def test_a_board_that_restarts_is_not_armed_until_it_is_checked_again() -> None:
    settings = [f"set {name} = {value}" for name, value in required(BetaflightOptions()).items()]
    board = BetaflightProcess([*settings, *mode_lines(), "save"])
    now_ns = 0
    stack = BetaflightBoard([board.port], BetaflightOptions(), rate=250, now_ns=lambda: now_ns)
    stack.set_motor_state(MotorState.OFF)

    def go(steps: int) -> None:
        nonlocal now_ns
        for _ in range(steps):
            board.step(STEP_NS, *REST)
            now_ns += STEP_NS
            stack.receive()
            stack.service(1e-9 * now_ns)

    go(2000)
    assert stack.obstacle == ""
    for line in ("#", "exit\n"):
        board.port.write(line.encode())
        for _ in range(200):
            board.step(STEP_NS, *REST)
    go(1000)
    assert stack.failures == [RESTARTED]
    go(9000)  # it could be armed by now
    stack.set_motor_state(MotorState.ON)
    go(1000)
    assert stack.obstacle == RESTARTED
    assert not any(board.step(STEP_NS, *REST)), "its motors turn"
    board.close()


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
    assert len(first[0]) > 30  # at 100 Hz, its default until it is set up


def test_a_board_that_has_ended_turns_no_motor() -> None:
    board = BetaflightProcess()
    board.kill()
    assert board.step(STEP_NS, *REST) == (0.0, 0.0, 0.0, 0.0)
    board.close()
