"""Boards are found by name: built-in ones, and those of installed packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from quadrotor.errors import UsageError
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle.boards.board import CommandKind
from vehicle.boards.kind import find_kind

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
    assert find_kind("mikrokopter").traits.direct is CommandKind.MOTORS
    betaflight = find_kind("betaflight")
    assert betaflight.traits.direct is CommandKind.RATES
    assert (betaflight.options, betaflight.rate) == (BetaflightOptions, 250)


@pytest.mark.usefixtures("package")
def test_a_package_brings_its_own() -> None:
    theirs = find_kind("theirs")
    assert (theirs.traits.name, theirs.rate) == ("theirs", 100)
    with pytest.raises(UsageError, match=r"'naze' is not known; there are .*theirs, wrong$"):
        find_kind("naze")
    with pytest.raises(UsageError, match=r"--board wrong: their_board:WRONG is no .*Kind"):
        find_kind("wrong")
