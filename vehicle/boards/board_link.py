"""The link to the board over the last second, from the counts that the board keeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

from vehicle.boards.board import Board, TellsLink
from vehicle_link.link_counts import LinkCounts


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """The statistics of a board's link; 0 where it does not tell.

    Attributes:
        command_rate: Hz, commands sent.
        round_trip: s, mean.
        acknowledged: share of packets, 0..1.
        retries: mean of the acknowledged packets.
        waiting: packets that wait to be sent.
    """

    command_rate: float = 0.0
    round_trip: float = 0.0
    acknowledged: float = 0.0
    retries: float = 0.0
    waiting: int = 0


class BoardLink:
    """Differences of a board's counts between two calls."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._before, self._before_ns = LinkCounts(), 0

    def statistics(self, now_ns: int) -> LinkStatistics:
        """Return the statistics since the last call; `now_ns` is from a monotonic clock."""
        if not isinstance(self._board, TellsLink):
            return LinkStatistics()
        now, before = replace(self._board.link), self._before
        duration_ns = now_ns - self._before_ns if self._before_ns else 0
        self._before, self._before_ns = now, now_ns
        acknowledged = now.acknowledged - before.acknowledged
        return LinkStatistics(
            _ratio(1e9 * (now.commands - before.commands), duration_ns),
            _ratio(
                1e-9 * (now.round_trips_ns - before.round_trips_ns), now.answered - before.answered
            ),
            _ratio(acknowledged, now.sent - before.sent),
            _ratio(now.retries - before.retries, acknowledged),
            now.waiting,
        )


def _ratio(part: float, whole: int) -> float:
    return part / whole if whole > 0 else 0.0
