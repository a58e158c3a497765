"""Options of a board have the same words for --check, flight and simulated board."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from extensions.betaflight.board.check import ENTER
from quadlab.__main__ import main
from quadlab.settings import parse_board_options
from quadrotor.errors import UsageError
from vehicle.boards.kind import find_kind
from vehicle.simulator.boards import firmware_of
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.process import run

FAST = "board.landing_speed=0.8"


def test_the_words_of_the_board_are_taken_out_and_checked() -> None:
    others, values = parse_board_options("betaflight", ["model.mass=0.7", FAST])
    assert (others, values) == (["model.mass=0.7"], {"landing_speed": 0.8})
    options = find_kind("betaflight").configured(values)
    assert options is not None
    assert options.model_dump()["landing_speed"] == 0.8


@pytest.mark.parametrize(
    ("board", "word", "said"),
    [
        ("betaflight", "board.landing_sped=1", "did you mean landing_speed"),
        ("betaflight", "board.failsafe_delay=1.5", "board.failsafe_delay=1.5"),
        ("crazyflie", "board.firmware.pid_rate.roll_kp=3", 'board.parameters=pid_rate.roll_kp=3"'),
        ("mikrokopter", "board.idle=3", "board mikrokopter has no options"),
    ],
)
@pytest.mark.parametrize("command", ["vehicle", "up", "simulator --folder ."])
def test_wrong_words_are_refused_the_same_everywhere(
    capsys: pytest.CaptureFixture[str], command: str, board: str, word: str, said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        parse_board_options(board, [word])
    assert main([*command.split(), "--board", board, "--set", word]) == 2
    assert said in capsys.readouterr().err


@pytest.fixture
def device(tmp_path: Path) -> Iterator[Path]:
    """Yield the port of a simulated board with an option."""
    stop = threading.Event()
    options = find_kind("betaflight").configured({"landing_speed": 0.8})
    board = threading.Thread(
        target=run,
        args=(SimulatorParameters(), tmp_path, None),
        kwargs={"stop": stop, "firmware": partial(firmware_of, "betaflight", options)},
    )
    board.start()
    yield tmp_path / "mcu0"
    stop.set()
    board.join()


@pytest.mark.needs("betaflight")
def test_a_real_board_fits_with_its_own_options_alone(device: Path) -> None:
    looked = threading.Event()
    while not device.exists():
        looked.wait(0.05)
    words = [sys.executable, "-m", "quadlab", "vehicle", "--board", "betaflight", "--check"]
    words += ["--serial", str(device)]
    one = subprocess.run([*words, "--set", FAST], capture_output=True, text=True, check=False)
    assert (one.returncode, one.stdout.splitlines()[-1]) == (0, "good"), one.stderr
    other = subprocess.run(words, capture_output=True, text=True, check=False)
    assert other.returncode == 1
    lines = other.stdout.splitlines()
    assert lines[lines.index(ENTER) + 1 :] == ["set alt_hold_climb_rate = 5  # it was 8", "save"]
