"""Comparison of estimators with the truth in flight: the vehicle's own, and others in parallel.

The input is what the station has: telemetry, the truth or the tracker's poses, frames of bearings.
No clock is read: the same input gives the same output. Single-threaded.
"""

from __future__ import annotations

import math
import struct
import time
from collections import deque
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import Beacons
from bearing_sim.emulator import BearingMeasurement
from bearing_sim.observability import frame_bound
from bearing_sim.pose_track import Pose
from extensions.comparison.bearings import residuals
from extensions.comparison.results import Comparison, Result
from extensions.comparison.samples import PacketEvent, SampleQueue
from extensions.comparison.shadow import Shadow
from extensions.comparison.statistics import QUATERNION, ErrorStatistics, errors
from extensions.comparison.truth import Row, Source, TruthMerge
from quadrotor.plain_rotations import rows_of
from quadrotor.records import STATE, Array, Record, beacon_ids_of, bearings_sample

if TYPE_CHECKING:
    from estimation.estimator import Estimator


VEHICLE = "vehicle"
SPACING_NS = 9_000_000
"""Shortest time between compared estimates, in ns: only the last of each packet of telemetry is
compared."""
ROWS, FRAMES = 200, 64
CARRIED_NS = 50_000_000
"""Longest time, in ns, over which an estimate is extrapolated to the instant of a frame."""
PATIENCE_NS = 500_000_000
"""Time in ns after which an estimate without a truth is reported without errors."""


class EstimatorComparison:
    """Estimates, errors, statistics and residuals.

    Args:
        say: called with a line when an estimator is stopped because of its own defect.
        timer: returns the processor time of the calling thread, s.
    """

    def __init__(
        self,
        say: Callable[[str], None] = lambda line: None,
        timer: Callable[[], float] = time.thread_time,
    ) -> None:
        self._say, self._timer = say, timer
        self._words: tuple[str, ...] = ()
        self._shadows: dict[str, Shadow] = {}
        self._armed = self._starting = False
        self._flown = False  # since the vehicle, or this process, was started
        self._start_over(SampleQueue())

    def _start_over(self, samples: SampleQueue) -> None:
        self._samples = samples
        self._merge = TruthMerge()
        self._rows: deque[Row] = deque(maxlen=ROWS)
        self._frames: deque[tuple[int, Record]] = deque(maxlen=FRAMES)
        self._compared: tuple[Row, Pose] | None = None
        self._reported_ns = -(1 << 62)
        self._statistics = {word: ErrorStatistics() for word in (VEHICLE, *self._words)}

    # ------------------------------------------------------------------ the set
    def choose(self, words: Sequence[str]) -> None:
        """Choose the results and their order, after the vehicle's. Those already chosen are not
        restarted.
        """
        self._words = tuple(words)
        for gone in self._shadows.keys() - set(words):
            del self._shadows[gone]
        self._statistics = {
            word: self._statistics.get(word) or ErrorStatistics() for word in (VEHICLE, *words)
        }

    def start(self, word: str, estimator: Estimator) -> None:
        """Start the estimator of a chosen word once it is compiled."""
        if word in self._words:
            self._shadows[word] = Shadow(estimator, self._timer)

    # ------------------------------------------------------------------ input
    def ticks(self, ticks: Record) -> None:
        """Handle the TICK (N,) of one packet of telemetry."""
        stretch = self._samples.packet(np.ascontiguousarray(ticks["imu"]))
        if stretch.event is PacketEvent.NOTHING_NEW:
            return
        if stretch.event is PacketEvent.RESTARTED:
            self._forget()
        elif stretch.event is PacketEvent.GAP:
            self._reset()
        for word, shadow in list(self._shadows.items()):
            try:
                shadow.advance(stretch.imu, stretch.steps, stretch.frames)
            except Exception as error:  # a defect in a compared estimator must end nothing else
                del self._shadows[word]
                self._say(f"comparing {word} stopped: {type(error).__name__}: {error}")
        stamp_ns = int(stretch.imu["stamp_ns"][-1])
        if not self._rows or stamp_ns - self._rows[-1].stamp_ns >= SPACING_NS:
            row = self._row(stamp_ns, ticks["state"][-1:])
            self._rows.append(row)
            self._merge.row(row)
            self._compare()

    def truth(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Handle a true pose: (3,) m, (4,) unit quaternion body to world."""
        self._pose("truth", stamp_ns, position_w, quaternion_wb)

    def tracker(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Handle a pose of the tracker, which counts as true when there is no better one."""
        self._pose("tracker", stamp_ns, position_w, quaternion_wb)

    def bearings(self, measurement: BearingMeasurement, beacons: Beacons) -> None:
        """Handle a frame, early or late, with the beacons at the time it was taken."""
        stamp_ns, ids, bearings_b, sigma, _ = measurement
        seen = bearings_sample(stamp_ns, ids, bearings_b, sigma)
        frame = KnownBeacons(beacons).with_positions(seen)
        self._frames.append((stamp_ns, frame))
        if frame["count"][0]:
            self._samples.frame(stamp_ns, frame)

    def status(self, armed: bool, starting: bool) -> None:
        """Begin a session at arming; reset the estimators when the vehicle has calibrated its
        gyroscope again.
        """
        if armed and not self._armed:
            self._flown = True
            for one in self._statistics.values():
                one.begin()
        if self._starting and not starting:
            self._reset()
        self._armed, self._starting = armed, starting

    # ------------------------------------------------------------------ output
    def report(self) -> Comparison | None:
        """Return the newest compared estimates, or None when nothing is newer than last time."""
        if not self._rows:
            return None
        row, true = self._rows[-1], None
        if self._compared and row.stamp_ns - self._compared[0].stamp_ns < PATIENCE_NS:
            row, true = self._compared
        if row.stamp_ns <= self._reported_ns:
            return None
        self._reported_ns = row.stamp_ns
        out = Comparison(
            row.stamp_ns,
            self._merge.source if true else "",
            self._statistics[VEHICLE].duration,
            [self._result(word, row) for word in (VEHICLE, *self._words)],
        )
        if true is not None:
            for result in out.results:
                state = result.state[None]
                [(result.position_error, result.attitude_error)] = errors(state, true)
        self._describe_bearings(out, true)
        return out

    def _result(self, word: str, row: Row) -> Result:
        out = Result(word)
        if word == VEHICLE:
            out.initialized = out.converged = True
        elif (shadow := self._shadows.get(word)) is not None:
            out.initialized = shadow.initialized
            out.converged = shadow.initialized and shadow.estimator.converged
            out.processor = shadow.processor
            if out.initialized:
                out.position_covariance, out.attitude_variance = shadow.covariance()
        if word in row.names:
            out.state = row.states[row.names.index(word)]
        statistics = self._statistics[word]
        out.recent, out.session = statistics.recent(row.stamp_ns), statistics.session()
        return out

    def _describe_bearings(self, out: Comparison, true: Pose | None) -> None:
        """Add bound and residuals of the newest frame for which there are estimates."""
        newest_ns = self._rows[-1].stamp_ns
        newest = max(
            (one for one in self._frames if one[0] <= newest_ns), key=itemgetter(0), default=None
        )
        if newest is None:
            return
        stamp_ns, frame = newest
        out.sigma = float(frame["sigma"][0])
        if true is not None:
            R = rows_of(true.quaternion_wb)
            out.position_bound, out.attitude_bound = frame_bound(
                true.position_w, R, frame["beacon_w"][0, : frame["count"][0]], out.sigma
            )
        row = next((one for one in reversed(self._rows) if one.stamp_ns <= stamp_ns), None)
        if row is None or stamp_ns - row.stamp_ns > CARRIED_NS:
            return
        angles = residuals(frame, row.states, 1e-9 * (stamp_ns - row.stamp_ns))
        for result in out.results:
            if result.name in row.names:
                result.beacon_ids = beacon_ids_of(frame)
                result.residuals = angles[row.names.index(result.name)].tolist()

    # ------------------------------------------------------------------ parts
    def _pose(self, source: Source, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        self._merge.pose(source, stamp_ns, position_w, quaternion_wb)
        self._compare()

    def _compare(self) -> None:
        counts = self._armed or not self._flown
        for row, true in self._merge.compared():
            self._compared = (row, true)
            lengths = errors(row.states, true)
            for word, (position, attitude) in zip(row.names, lengths, strict=True):
                if word in self._statistics:
                    self._statistics[word].add(row.stamp_ns, position, attitude, counts)

    def _row(self, stamp_ns: int, own: Record) -> Row:
        """Return the present state of every estimator; NaN for those that are not initialized."""
        rows = [_numbers(own)]
        for shadow in self._shadows.values():
            rows.append(_numbers(shadow.state) if shadow.initialized else [math.nan] * 13)
        for row in rows:
            length = math.hypot(*row[QUATERNION]) or 1.0
            row[QUATERNION] = [x / length for x in row[QUATERNION]]
        return Row(stamp_ns, (VEHICLE, *self._shadows), np.array(rows))

    def _reset(self) -> None:
        for shadow in self._shadows.values():
            shadow.reset()

    def _forget(self) -> None:
        """Forget everything, because the vehicle has restarted: its clock, position and biases
        differ.
        """
        self._reset()
        # The queue noticed the restart itself, and has the next samples.
        self._start_over(self._samples)
        self._armed = self._flown = False


def _numbers(state: Record) -> list[float]:
    """Return a STATE (1,) as 13 numbers."""
    return list(struct.unpack("13d", state.tobytes()))


assert STATE.itemsize == 13 * 8
