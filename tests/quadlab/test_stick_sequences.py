"""Stick movements that are played back: scripted and recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from console.experiments.stick_sequences import STRONGEST, recorded, scripted
from quadrotor.errors import StorageError, UsageError


def test_scripted_sticks_are_those_of_their_seed_within_bounds_and_move() -> None:
    one, again, other = scripted(5, 30.0), scripted(5, 30.0), scripted(6, 30.0)
    assert one.shape == (1500, 4)
    assert (one == again).all()
    assert not np.allclose(one, other)
    assert (np.abs(one) <= np.array(STRONGEST) + 1e-12).all()
    assert (np.sqrt(np.mean(one**2, axis=0)) > 0.1).all()
    assert np.abs(np.diff(one, axis=0)).max() < 0.15  # movements of thumbs, not steps


def test_recorded_sticks_hold_until_the_next_row(tmp_path: Path) -> None:
    file = tmp_path / "sticks.csv"
    file.write_text("t,forward,left,up,yaw\n1.0,0,0,0,0\n1.1,0.5,-1,0,0.25\n1.3,0,0,0,0\n")
    sticks = recorded(file)
    assert sticks.shape == (15, 4)
    assert (sticks[:5] == 0.0).all()
    assert sticks[5:] == pytest.approx(np.tile([0.5, -1.0, 0.0, 0.25], (10, 1)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1"),
        ("t,forward,left,up\n", "begins with the line t,forward,left,up,yaw"),
        ("t,forward,left,up,yaw\n0,0,0,0,0\n", "1 rows"),
        ("t,forward,left,up,yaw\n0,0,0,0\n1,0,0,0,0\n", "line 2: 4 columns"),
        ("t,forward,left,up,yaw\n0,0,0,0,0\n1,0,2,0,0\n", "line 3, column left: '2'; allowed -1"),
        ("t,forward,left,up,yaw\n0,0,0,0,0\n1,0,nan,0,0\n", "line 3, column left: 'nan'"),
        ("t,forward,left,up,yaw\n0,0,0,0,0\n1,0,0,0,0\n1,0,0,0,0\n", "line 4, column t: not later"),
    ],
)
def test_a_file_that_is_none_is_refused_by_line_and_column(
    tmp_path: Path, text: str, said: str
) -> None:
    file = tmp_path / "sticks.csv"
    file.write_text(text)
    with pytest.raises(UsageError) as caught:
        recorded(file)
    assert said in str(caught.value)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"none\.csv cannot be read"):
        recorded(tmp_path / "none.csv")
