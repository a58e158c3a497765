"""Boards are found by name: built-in ones, and those of installed packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from extensions.betaflight.board.options import BetaflightOptions
from extensions.crazyflie.board.options import CrazyflieOptions
from quadrotor.errors import OutOfBoundsError, UsageError
from quadrotor.parameters import ParameterStore
from vehicle.boards.board import CommandKind
from vehicle.boards.kind import find_kind
from vehicle.parameters import check_hover, check_pairs, new_parameters

THEIRS = """
from vehicle.boards.board import CommandKind, Traits
from vehicle.boards.kind import Kind

KIND = Kind(Traits("theirs", (CommandKind.RATES,)), lambda *_: None, rate=100)
WRONG = "a board"
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "their_board.py").write_text(THEIRS)
    facts = tmp_path / "their_board-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: their-board\nVersion: 1.0\n")
    entries = "theirs = their_board:KIND\nwrong = their_board:WRONG\n"
    (facts / "entry_points.txt").write_text(f"[quadlab.boards]\n{entries}")
    monkeypatch.syspath_prepend(tmp_path)


def test_ours_are_there_with_what_they_take() -> None:
    assert find_kind("mikrokopter").traits.takes[0] is CommandKind.MOTORS
    betaflight = find_kind("betaflight")
    assert betaflight.traits.takes[0] is CommandKind.RATES
    assert (betaflight.options, betaflight.rate) == (BetaflightOptions, 250)
    crazyflie = find_kind("crazyflie")
    assert crazyflie.traits.takes[0] is CommandKind.RATES
    assert (crazyflie.options, crazyflie.rate, crazyflie.is_asked) == (CrazyflieOptions, 100, True)


def test_the_option_level_moves_where_the_law_ends() -> None:
    kind = find_kind("betaflight")
    rates = kind.traits_with(kind.configured({}))
    assert rates == kind.traits
    angles = kind.traits_with(kind.configured({"level": "angles", "angle_gain": 6.0}))
    assert angles.takes == (CommandKind.ANGLES, CommandKind.RATES)
    assert angles.angle_gain == 6.0
    assert find_kind("mikrokopter").traits_with(None).takes[0] is CommandKind.MOTORS


@pytest.mark.usefixtures("package")
def test_a_package_brings_its_own() -> None:
    theirs = find_kind("theirs")
    assert (theirs.traits.name, theirs.rate) == ("theirs", 100)
    with pytest.raises(UsageError, match=r"'naze' is not known; there are .*theirs, wrong$"):
        find_kind("naze")
    with pytest.raises(UsageError, match=r"--board wrong: their_board:WRONG is not a .*Kind"):
        find_kind("wrong")


@pytest.mark.parametrize("board", ["mikrokopter", "betaflight", "crazyflie"])
def test_each_boards_model_can_hover_and_a_mass_that_cannot_is_refused(board: str) -> None:
    store = ParameterStore(new_parameters())
    store.preset(find_kind(board).traits.parameters)
    check_pairs(store.values())
    check_hover(store.values())
    wrong = 0.03 if board != "crazyflie" else 0.5
    with pytest.raises(OutOfBoundsError, match=rf"model\.mass = {wrong:g} kg cannot hover: "):
        check_hover(store.values() | {"model.mass": wrong})
