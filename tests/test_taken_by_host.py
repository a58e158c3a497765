"""Real-time flights that are not judged: the host of a virtual machine took its processors."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import MOST_TAKEN, processor_time, taken_by_host


def test_time_had_and_time_taken_are_those_of_the_kernel(tmp_path: Path) -> None:
    stat = tmp_path / "stat"
    stat.write_text("cpu  100 20 30 4000 500 6 7 80 9 9\ncpu0 1 1 1 1 1 1 1 1 1 1\n")
    assert processor_time(stat) == (100 + 20 + 30 + 6 + 7, 80), "neither idle nor guests' twice"
    had, taken = processor_time()
    assert had > 0
    assert taken >= 0


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [((100, 5), (190, 15), 0.1), ((100, 5), (200, 5), 0.0), ((100, 5), (100, 5), 0.0)],
)
def test_the_share_is_of_the_time_wanted(
    before: tuple[int, int], after: tuple[int, int], share: float
) -> None:
    assert taken_by_host(before, after) == pytest.approx(share)
    assert 0.0 < MOST_TAKEN < 0.1
