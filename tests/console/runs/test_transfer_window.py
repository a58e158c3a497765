"""Number of requested pieces in transit, over links of known rate and distance."""

from __future__ import annotations

from random import Random

import pytest

from console.transfers.request_window import HOLD, MAX_REQUESTS, RequestWindow

PIECE = 2800 * 8  # bit


class Link:
    """Link of this rate and round trip, which answers `window.size` at a time."""

    def __init__(self, rate: float, trip: float, jitter: float = 0.0, seed: int = 3) -> None:
        print(f"seed {seed}")
        self.rate, self.trip, self.jitter, self._drawn = rate, trip, jitter, Random(seed)
        self.now = 0.0
        self.window = RequestWindow(lambda: self.now)
        self.sizes: list[int] = []

    def run(self, seconds: float) -> None:
        until = self.now + seconds
        while self.now < until:
            size = self.window.size
            # A request on a full link waits for its turn.
            seconds = max(self.trip, size * PIECE / self.rate)
            seconds += self._drawn.uniform(0.0, self.jitter)
            for _ in range(size):
                self.window.answered(size, seconds)
            self.sizes.append(size)
            self.now += seconds

    @property
    def throughput(self) -> float:
        """Return the share of the rate at the size found."""
        return min(1.0, self.window.size * PIECE / self.rate / self.trip)


def test_a_narrow_link_gets_one_at_a_time_and_is_seldom_tried_with_two() -> None:
    link = Link(rate=1.1e6, trip=0.012)
    link.run(10.0 * HOLD)
    assert link.window.size == 1
    assert sum(size > 1 for size in link.sizes) / len(link.sizes) < 0.01


@pytest.mark.parametrize(("rate", "trip"), [(20e6, 0.01), (50e6, 0.005), (10e6, 0.02), (5e6, 0.05)])
def test_a_far_link_is_filled(rate: float, trip: float) -> None:
    link = Link(rate, trip)
    link.run(5.0)
    assert link.throughput > 0.7
    assert link.window.size * PIECE / rate < 3.0 * trip  # and not flooded


def test_a_link_that_has_room_for_all_gets_the_most() -> None:
    link = Link(rate=1e9, trip=0.02)
    link.run(10.0)
    assert link.window.size == MAX_REQUESTS


def test_jitter_does_not_stop_it() -> None:
    link = Link(rate=20e6, trip=0.02, jitter=0.01)
    link.run(10.0)
    assert link.window.size >= 8


def test_it_follows_a_link_that_narrows_and_widens_again() -> None:
    link = Link(rate=50e6, trip=0.01)
    link.run(5.0)
    assert link.window.size >= 8
    link.rate = 1.1e6
    link.run(5.0)
    assert link.window.size == 1
    link.rate = 50e6
    link.run(2.0 * HOLD)
    assert link.window.size >= 8
