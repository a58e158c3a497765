"""The offset of a track's stamps against the IMU's clock, found by the motion of both."""

from __future__ import annotations

import numpy as np

from estimation.calibration.motion import STEP, best_lag, common_grid, joined
from estimation.calibration.segmented_fit import solve_segments
from extensions.importers.raw import RawTrack
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

NEAR = 5.0
"""Largest offset, in s, between stamps of the same clock."""
SMALLEST_OFFSET = 5e-4
"""Smallest offset, in s, that is corrected."""
SURE = 3.0
"""Multiple of its standard error from which on something found in a flight is corrected."""
SEGMENT = 1.0
"""Length, in s, of the parts of a signal whose errors count as independent."""
RATES = tuple(1.0 + 2e-3 * k for k in range(-10, 11))
"""Rates of a track's clock to the IMU's among which its motion decides."""
PRIOR = (1.0, 0.05)
"""Prior deviations of an offset (s) and of its drift."""
LONG = 20.0
"""Shortest time, in s, over which a drift is judged."""
NOTABLE = 0.02
"""Change of an offset, in s, within a flight that is worth a note."""


class TrackClock:
    """The clock of one track.

    Args:
        seconds: of the IMU's samples, (N,).
        notes: gets lines about what is found.

    Attributes:
        offset: s, added to the track's stamps; as the mapping states it until `settle` finds it.
        rate: of the IMU's clock to the track's, about the middle of the track.
    """

    def __init__(self, seconds: Array, raw: RawTrack, notes: list[str]) -> None:
        self._seconds, self._raw, self._notes = seconds, raw, notes
        stated = raw.rows.time_offset
        self.offset = stated if isinstance(stated, float) else 0.0
        self.rate = 1.0
        self._middle = 0.5 * float(raw.seconds[0] + raw.seconds[-1])

    @property
    def at(self) -> Array:
        """Return the track's stamps on the IMU's clock, s."""
        since = self._raw.seconds - self._middle
        at: Array = self._middle + self.rate * since + self.offset
        return at

    @property
    def rates(self) -> tuple[float, ...]:
        """Return the rates to try: the stated one, or those of two crystals and a timer."""
        return RATES if self._raw.rows.time_scale == 1.0 else (1.0,)

    def grids(self) -> tuple[Array, Array]:
        """Return the grids of the IMU and of the track: the same one if their clocks overlap."""
        at = self.at
        motion_alone = self._raw.rows.time_offset == "motion"
        if not motion_alone and min(self._seconds[-1], at[-1]) - max(self._seconds[0], at[0]) > 5.0:
            grid = common_grid(self._seconds, at)
            return grid, grid
        return np.arange(self._seconds[0], self._seconds[-1], STEP), np.arange(at[0], at[-1], STEP)

    def lag(
        self, one: Array, other: Array, mine: Array, theirs: Array, *, same_axes: bool = True
    ) -> float:
        """Return the shift for the track's stamps, s; from lengths if their axes may differ."""
        if not same_axes:
            one, other = (np.linalg.norm(x, axis=1, keepdims=True) for x in (one, other))
        most = round(NEAR / STEP) if mine is theirs else max(len(one), len(other))
        shift, _ = best_lag(one, other, min(most, len(one) // 2) if mine is theirs else most)
        return float(mine[0] - theirs[0] - shift * STEP)

    def checked_lag(self, one: Array, other: Array, mine: Array, theirs: Array) -> float:
        """Return the lag of signals in the same axes. Raises LogFormatError for two clocks."""
        lag = self.lag(one, other, mine, theirs)
        name, stated = self._raw.name, self._raw.rows.time_offset
        apart = mine[0] > theirs[-1] or theirs[0] > mine[-1]
        if apart and stated is None:
            raise LogFormatError(
                f"[{name}] has stamps of another clock than [imu]: {theirs[0]:.1f} to "
                f"{theirs[-1]:.1f} s after the IMU's first sample, which ends at {mine[-1]:.1f} s; "
                f"the motion of both fits with time_offset = {lag:.3f} in [{name}]"
            )
        return lag

    def settle(self, one: Array, other: Array, mine: Array, theirs: Array) -> None:
        """Find the offset of the stamps from two signals in the same axes. Raises LogFormatError
        for two clocks.
        """
        lag = self.checked_lag(one, other, mine, theirs)
        own, moved = joined(mine, one, theirs + lag, other)
        slope = np.gradient(moved, STEP, axis=0)
        since = (np.arange(len(own)) - 0.5 * len(own)) * STEP
        columns = np.stack([slope, slope * since[:, None]], axis=2)
        parts = np.array_split(np.arange(len(own)), max(2, round(len(own) * STEP / SEGMENT)))
        bases = [np.ones((len(rows), 1)) for rows in parts]
        fit = solve_segments(columns, own - moved, parts, bases, PRIOR, None)
        self.take(-lag, float(fit.deviations[0]))
        self.tell_drift(float(-fit.values[1]), float(fit.deviations[1]), len(own) * STEP)

    def take(self, delay: float, deviation: float) -> None:
        """Correct the stamps by a delay (s) that is surely not 0, unless their offset is stated."""
        name, stated = self._raw.name, self._raw.rows.time_offset
        finding = f"{delay * 1e3:.1f} ± {deviation * 1e3:.1f} ms"
        sure = abs(delay) > SURE * deviation
        if isinstance(stated, float):
            if abs(delay) > 2 * STEP and sure:
                self._notes.append(
                    f"[{name}] time_offset = {stated:g} is kept; "
                    f"the motion suggests {stated - delay:.4f}"
                )
        elif sure and abs(delay) >= SMALLEST_OFFSET:
            self.offset = -delay
            self._notes.append(
                f"[{name}] its stamps are {finding} late against the IMU's, by the "
                "motion of both: corrected"
            )
        else:
            self._notes.append(f"[{name}] its clock is the IMU's: its stamps are {finding} late")

    def tell_drift(self, drift: float, deviation: float, seconds: float) -> None:
        """Note a drift of the delay (s/s) that matters within the flight and is surely not 0."""
        if seconds > LONG and abs(drift) * seconds > NOTABLE and abs(drift) > SURE * deviation:
            scale = self.rate * self._raw.rows.time_scale * (1.0 - drift)
            self._notes.append(
                f"[{self._raw.name}] its clock drifts by {drift * 1e6:.0f} ppm against the IMU's; "
                f"time_scale = {scale:.7f} corrects it"
            )
