"""The link to the board: what its counts say about the last second."""

from __future__ import annotations

from typing import cast

import pytest

from vehicle.boards.board import Board
from vehicle.boards.board_link import BoardLink, LinkStatistics
from vehicle_link.link_counts import LinkCounts

SECOND_NS = 1_000_000_000


class Counting:
    """A board that only counts."""

    def __init__(self) -> None:
        self.link = LinkCounts()


def test_only_the_counts_since_the_last_call_are_used() -> None:
    board = Counting()
    link = BoardLink(cast("Board", board))
    board.link = LinkCounts(1000, 100, 5 * SECOND_NS, 400, 100, 900, 3)
    link.statistics(7 * SECOND_NS)
    board.link = LinkCounts(1500, 104, 5 * SECOND_NS + 8_000_000, 600, 290, 1090, 2)
    statistics = link.statistics(9 * SECOND_NS)
    assert statistics.command_rate == 250.0
    assert statistics.round_trip == pytest.approx(0.002)
    assert statistics.acknowledged == 0.95
    assert statistics.retries == 1.0
    assert statistics.waiting == 2


def test_a_board_that_tells_nothing_gives_zeros() -> None:
    assert BoardLink(cast("Board", object())).statistics(SECOND_NS) == LinkStatistics()
    link = BoardLink(cast("Board", Counting()))
    assert link.statistics(SECOND_NS) == link.statistics(2 * SECOND_NS) == LinkStatistics()
