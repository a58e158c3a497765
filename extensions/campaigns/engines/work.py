"""The flights that are still to be flown, as tasks of a second or more for an engine."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from extensions.campaigns.flights import TIMED_OUT, WORKER_DIED, Outcome, Task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.shard import Shard

SHORTEST = 1.0
"""s that a task should last: the work around it then counts for little."""
OF_EACH = 0.01
"""s that a task should last for each worker: what hands out the tasks has then 1 ms for each, at a
tenth of its time.
"""
LARGEST = 2000
"""Flights in a task at most."""
DEATHS = 3
"""Workers that may die with a flight before it is given up."""
KEPT_SHARE, KEPT_LONGEST = 0.02, 30.0
"""Rows are written after this share of the time so far, and at most after so many s."""


@dataclass
class Work:
    """The tasks of a campaign, and the rows that are not written yet.

    Args:
        todo: indices of the flights to be flown, in order.
        tell: called with the outcomes of each task.
    """

    folder: CampaignFolder
    shard: Shard
    todo: Sequence[int]
    tell: Callable[[Sequence[Outcome]], None] = lambda found: None
    _taken: int = 0
    _again: deque[Task] = field(default_factory=deque)
    _deaths: Counter[int] = field(default_factory=Counter)
    _cost: float = math.inf
    _held: list[Outcome] = field(default_factory=list)
    _began: float = field(default_factory=time.monotonic)
    _wrote: float = field(default_factory=time.monotonic)

    @property
    def limit(self) -> float:
        """Return the s of wall time that a flight may last."""
        return self.folder.plan.plan.time_limit

    def take(self, workers: int = 1) -> Task | None:
        """Return the next task, None when all are taken."""
        if self._again:
            return self._again.popleft()
        left = len(self.todo) - self._taken
        if left <= 0:
            return None
        lasting = max(SHORTEST, OF_EACH * workers)
        size = math.ceil(lasting / self._cost) if self._cost > 0.0 else LARGEST
        size = max(1, min(size, LARGEST, math.ceil(left / workers)))
        chosen = self.todo[self._taken : self._taken + size]
        self._taken += len(chosen)
        return self.folder.task(chosen)

    def back(self, task: Task) -> None:
        """Take a task back that no worker has begun."""
        self._again.appendleft(task)

    def finished(self, outcomes: Sequence[Outcome]) -> None:
        """Take the outcomes of a task; write rows when it is time."""
        cost = sum(one.wall for one in outcomes) / max(1, len(outcomes))
        self._cost = cost if math.isinf(self._cost) else min(cost, 0.7 * self._cost + 0.3 * cost)
        self._held += outcomes
        self.tell(outcomes)
        now = time.monotonic()
        pause = min(KEPT_LONGEST, max(1.0, KEPT_SHARE * (now - self._began)))
        if now - self._wrote >= pause:
            self.write()

    def died(self, task: Task) -> None:
        """Have the flights of a worker that has died flown again, each by itself."""
        if len(task.indices) > 1:
            self._again.extendleft(self.folder.task([index]) for index in reversed(task.indices))
            return
        (index,) = task.indices
        self._deaths[index] += 1
        if self._deaths[index] < DEATHS:
            self._again.appendleft(task)
        else:
            self.given_up(index)

    def given_up(self, index: int) -> None:
        """End a flight with which each worker has died."""
        self.finished([Outcome(index, WORKER_DIED, "each worker that flew it died")])

    def timed_out(self, task: Task) -> None:
        """End a flight that has lasted too long; several are flown again, each by itself."""
        if len(task.indices) > 1:
            self.died(task)
            return
        reason = f"no end within {self.limit:g} s of wall time"
        self.finished([Outcome(task.indices[0], TIMED_OUT, reason)])

    def write(self) -> None:
        """Write the rows that are held."""
        held, self._held = self._held, []
        if held:
            self.folder.add(held, self.shard)
        self._wrote = time.monotonic()
