"""Laws of users' files in the arena: as good as the vehicle flies them, and out when they fail."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from control.trajectories.figure_eight import FigureEight
from extensions.laws.arena.cells import DISTURBANCES, Entry, chosen
from extensions.laws.arena.flights import fly_cell
from extensions.laws.arena.own_laws import own_laws
from extensions.laws.arena.tuned import tuned
from quadlab.__main__ import main
from quadrotor.errors import UsageError
from vehicle.laws.offer import offer_laws

SHORT = FigureEight((0.0, 0.0, 1.5), period=4.0, laps=2, ramp=2.0)
HOVERING = """class law:
    def reset(self):
        pass

    def step(self, x):
        weight = 9.81 * x.mass
        return weight + 0.0 * ({late}), (0.0, 0.0, 0.0)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """Return a folder with the law that `quadlab new law` writes, whose name is offered."""
    assert main(["new", "law", "mine", "--out", str(tmp_path)]) == 0
    offer_laws(tmp_path)
    yield tmp_path
    offer_laws(None)


def entry(folder: Path) -> Entry:
    (found,) = chosen("mine", own_laws(folder))
    return found


def test_a_new_law_flies_at_once_and_the_same_each_time(folder: Path) -> None:
    """The plain law in Python, but for a derivative and the lead of the rotors."""
    mine, (plain,) = entry(folder), chosen("geometric")
    errors = [
        fly_cell(one, DISTURBANCES["nominal"], SHORT, (1,)).rms for one in (mine, mine, plain)
    ]
    assert errors[0] == errors[1]
    assert errors[2] < errors[0] < 2.5 * errors[2]


@pytest.mark.parametrize(
    ("late", "why"),
    [
        ("1.0 / int(x.time < 0.5)", r"mine\.py line 7: ZeroDivisionError: "),
        ("float('nan') if x.time > 0.5 else 0.0", r"it answered \[nan, .*\], which is not finite"),
    ],
)
def test_a_law_that_fails_in_flight_crashes_and_tells_why(
    folder: Path, late: str, why: str
) -> None:
    (folder / "mine.py").write_text(HOVERING.format(late=late))
    mine = entry(folder)
    assert np.isnan(fly_cell(mine, DISTURBANCES["nominal"], SHORT, (1,)).rms).all()
    assert mine.own is not None
    (told,) = mine.own.failures
    assert re.match(why, told)


def test_mistakes_in_a_file_are_told_before_the_first_flight(folder: Path) -> None:
    (folder / "mine.py").write_text("def law():\n    return None\n")
    with pytest.raises(UsageError, match=r"mine\.py: NoneType has no method reset"):
        chosen("geometric mine", own_laws(folder))
    chosen("geometric", own_laws(folder))  # others fly
    with pytest.raises(UsageError, match=r"there are geometric, .*nmpc, mine"):
        chosen("yours", own_laws(folder))
    (folder / "mine.fmu").write_bytes(b"")
    with pytest.raises(UsageError, match=r"one name, mine\.fmu and mine\.py; rename one"):
        chosen("mine", own_laws(folder))
    with pytest.raises(UsageError, match=r"mine is of a file.*leave it out of --laws"):
        tuned([Entry("mine", "mine", own=own_laws(folder)["mine"])], folder)
