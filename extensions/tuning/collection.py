"""Collects the answers about an interval of the vehicle's log, and checks that it is complete."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.errors import StorageError
from quadrotor.json_object import JsonObject
from quadrotor.records import Stamps
from vehicle_link.messages.records import OnboardLogResponse

Floats = npt.NDArray[np.float32]

EMPTY_ANSWERS_MAX = 8
"""Number of answers in a row without anything new after which the collection ends."""
GAP_PERIODS = 2.5
"""Distance of two ticks, in usual periods, above which there is a gap; a single missing tick hides
nothing of the response."""
EDGE = 20_000_000
"""Time in ns that may be missing at either end of the interval: the longest duration of a tick."""


@dataclass(frozen=True, slots=True)
class Gap:
    """A gap in the samples; times in s since the first tick."""

    start: float
    end: float


class Collection:
    """Collects an interval: send each `question` and pass its answer to `add`, until `done`.

    Args:
        columns: names, as in flight_log.tick_columns.
        start_ns, end_ns: of the vehicle's clock.
    """

    def __init__(self, columns: tuple[str, ...], start_ns: int, end_ns: int) -> None:
        self.columns = columns
        self._start_ns, self._end_ns = start_ns, end_ns
        self._next_ns = start_ns
        self._stamps: list[Stamps] = []
        self._values: list[Floats] = []
        self._empty_answers = 0
        self.done = False
        self.file = ""
        self.problem = ""

    @property
    def question(self) -> JsonObject:
        """Return the fields of the next request."""
        return {
            "columns": list(self.columns),
            "start_ns": self._next_ns,
            "end_ns": self._end_ns,
            "rows": 0,
        }

    @property
    def share(self) -> float:
        """Return the received share of the interval, 0..1."""
        if self.done:
            return 1.0
        return (self._next_ns - self._start_ns) / max(1, self._end_ns - self._start_ns)

    def add(self, answer: OnboardLogResponse) -> None:
        """Add an answer. Raises StorageError when it does not match the request."""
        stamps = np.asarray(answer.stamps_ns, np.int64)
        width = len(self.columns)
        values = np.asarray(answer.values, np.float32)
        rising = len(stamps) == 0 or bool(
            stamps[0] >= self._next_ns
            and stamps[-1] <= self._end_ns
            and (np.diff(stamps) > 0).all()
        )
        if len(values) != len(stamps) * width or not rising:
            raise StorageError(
                f"{len(stamps)} ticks with {len(values)} numbers do not answer a request for "
                f"{width} columns from {self._next_ns} to {self._end_ns} ns"
            )
        self.file = str(answer.file) or self.file
        if answer.damaged:
            self.problem = f"{answer.damaged} blocks of the vehicle's log are damaged"
        if len(stamps):
            self._stamps.append(stamps)
            self._values.append(values.reshape(-1, width))
            self._next_ns = int(stamps[-1]) + 1
            self._empty_answers = 0
        else:
            self._empty_answers += 1
        self.done = bool(answer.complete) or self._next_ns > self._end_ns
        if not self.done and self._empty_answers >= EMPTY_ANSWERS_MAX:
            self.done = True
            self.problem = "the vehicle's log was not written to the end of the test"

    def failed(self, why: str) -> bool:
        """Note that a request had no answer; return whether to retry."""
        self._empty_answers += 1
        if self._empty_answers < EMPTY_ANSWERS_MAX:
            return True
        self.done, self.problem = True, why
        return False

    def result(self) -> Samples:
        """Return all received samples. Raises StorageError when there are none."""
        if not self._stamps:
            why = self.problem or "it has no data from that time"
            raise StorageError(f"the vehicle's log could not be read: {why}")
        stamps, values = np.concatenate(self._stamps), np.concatenate(self._values)
        time = (stamps - stamps[0]) * 1e-9
        period = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
        holes = np.flatnonzero(np.diff(time) > GAP_PERIODS * period)
        gaps = [Gap(float(time[i]), float(time[i + 1])) for i in holes]
        missing_first = (int(stamps[0]) - self._start_ns) * 1e-9
        missing_last = (self._end_ns - int(stamps[-1])) * 1e-9
        if missing_first > EDGE * 1e-9:
            gaps.insert(0, Gap(-missing_first, 0.0))
        if missing_last > EDGE * 1e-9:
            gaps.append(Gap(float(time[-1]), float(time[-1]) + missing_last))
        return Samples(
            stamps,
            {n: values[:, j] for j, n in enumerate(self.columns)},
            tuple(gaps),
            self.problem,
            self.file,
        )


@dataclass(frozen=True)
class Samples:
    """An interval of the log.

    Attributes:
        stamps_ns: shape (N,), of the vehicle's clock.
        values: by column, shape (N,).
        gaps: in order; empty when no tick is missing.
        problem: what else is wrong, or empty.
        file: on the vehicle.
    """

    stamps_ns: Stamps
    values: dict[str, Floats]
    gaps: tuple[Gap, ...]
    problem: str
    file: str

    @property
    def rate(self) -> float:
        """Return the rate in Hz, from the median of the periods."""
        return 1e9 / float(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else 0.0

    @property
    def single(self) -> int:
        """Return the number of single missing ticks, which are no gap."""
        steps = np.diff(self.stamps_ns) / np.median(np.diff(self.stamps_ns))
        return int(np.count_nonzero((steps > 1.6) & (steps <= GAP_PERIODS)))

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """Return the seconds since the first tick, shape (N,)."""
        time: npt.NDArray[np.float64] = (self.stamps_ns - self.stamps_ns[0]) * 1e-9
        return time
