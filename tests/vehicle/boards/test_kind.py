"""Boards are found by name: built-in ones, and those of installed packages."""

from __future__ import annotations

from pathlib import Path

import pytest

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


def test_the_papers_board_is_there_with_what_it_takes() -> None:
    kind = find_kind("mikrokopter")
    assert kind.traits.takes[0] is CommandKind.MOTORS
    assert kind.traits_with(None).takes[0] is CommandKind.MOTORS


@pytest.mark.usefixtures("package")
def test_a_package_brings_its_own() -> None:
    theirs = find_kind("theirs")
    assert (theirs.traits.name, theirs.rate) == ("theirs", 100)
    with pytest.raises(UsageError, match=r"'naze' is not known; there are .*theirs, wrong$"):
        find_kind("naze")
    with pytest.raises(UsageError, match=r"--board wrong: their_board:WRONG is not a .*Kind"):
        find_kind("wrong")


def test_its_model_can_hover_and_a_mass_that_cannot_is_refused() -> None:
    store = ParameterStore(new_parameters())
    store.preset(find_kind("mikrokopter").traits.parameters)
    check_pairs(store.values())
    check_hover(store.values())
    with pytest.raises(OutOfBoundsError, match=r"model\.mass = 0.03 kg cannot hover: "):
        check_hover(store.values() | {"model.mass": 0.03})
