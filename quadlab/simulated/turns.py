"""Vehicles of one process that take turns: each flies until it meets the others, then waits.

The flight of each is a greenlet, so an experiment is written as for one vehicle: its waits run the
others' turns.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, TypeVar

from greenlet import getcurrent, greenlet

from quadlab.simulated.meeting import Meeting

T = TypeVar("T")


class Turns(Generic[T]):
    """The turns of the vehicles of one process.

    Args:
        meeting: of all vehicles.
        flights: by the vehicle's index; each calls `wait` before it flies, at each meeting, and
            `end` once it has flown.

    Attributes:
        wall, processor: s, of flying alone.
    """

    def __init__(self, meeting: Meeting, flights: Mapping[int, Callable[[], T]]) -> None:
        self._meeting = meeting
        self._flights = flights
        self._flying: set[greenlet] = set()
        self._hub = getcurrent()
        self.wall = self.processor = 0.0

    def run(self) -> list[T]:
        """Run all flights in turns, and return their results. Raises a flight's first error."""
        found: dict[int, T] = {}

        def fly(index: int, flight: Callable[[], T]) -> None:
            found[index] = flight()

        turns = [greenlet(fly) for _ in self._flights]
        self._flying = set(turns)
        for turn, (index, flight) in zip(turns, self._flights.items(), strict=True):
            turn.switch(index, flight)
        began, processor = time.perf_counter(), time.process_time()
        while True:
            self._each(turns)
            if not self._flying:
                break
            self._meeting.meet()
        self._meeting.leave()
        self.wall, self.processor = time.perf_counter() - began, time.process_time() - processor
        for turn in turns:  # judged one after the other
            turn.switch()
        return [found[index] for index in self._flights]

    def wait(self) -> None:
        """End this turn: until the next meeting, or the start of all."""
        self._hub.switch()

    def end(self) -> None:
        """End the flight of this vehicle, and wait until all of this process have flown."""
        self._flying.discard(getcurrent())
        self._hub.switch()

    def _each(self, turns: Sequence[greenlet]) -> None:
        for turn in turns:
            if turn in self._flying:
                turn.switch()
