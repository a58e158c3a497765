"""The offset of a track's stamps against the IMU's clock, found by the motion of both."""

from __future__ import annotations

import numpy as np

from estimation.calibration.motion import STEP, best_lag, common_grid
from flight_log.imports.raw import RawTrack
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

NEAR = 5.0
"""Largest offset, in s, between stamps of the same clock."""
SMALLEST_OFFSET = 5e-4
"""Smallest offset, in s, that is corrected."""


class TrackClock:
    """The clock of one track.

    Args:
        seconds: of the IMU's samples, (N,).
        notes: gets lines about what is found.

    Attributes:
        offset: s, added to the track's stamps; as the mapping states it until `settle` finds it.
    """

    def __init__(self, seconds: Array, raw: RawTrack, notes: list[str]) -> None:
        self._seconds, self._raw, self._notes = seconds, raw, notes
        stated = raw.rows.time_offset
        self.offset = stated if isinstance(stated, float) else 0.0

    @property
    def at(self) -> Array:
        """Return the track's stamps on the IMU's clock, s."""
        at: Array = self._raw.seconds + self.offset
        return at

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

    def settle(self, one: Array, other: Array, mine: Array, theirs: Array) -> None:
        """Find the offset of the stamps; both signals are already in the same axes."""
        lag = self.lag(one, other, mine, theirs)
        name, stated = self._raw.name, self._raw.rows.time_offset
        share = best_lag(one, other, 0)[1] if mine is theirs else 1.0
        apart = mine[0] > theirs[-1] or theirs[0] > mine[-1]
        if apart and stated is None:
            raise LogFormatError(
                f"[{name}] has stamps of another clock than [imu]: {theirs[0]:.1f} to "
                f"{theirs[-1]:.1f} s after the IMU's first sample, which ends at {mine[-1]:.1f} s; "
                f"the motion of both fits with time_offset = {lag:.3f} in [{name}]"
            )
        if isinstance(stated, float):
            if abs(lag) > 2 * STEP and share < 0.98:
                self._notes.append(
                    f"[{name}] time_offset = {stated:g} is kept; "
                    f"the motion suggests {stated + lag:.4f}"
                )
            return
        if abs(lag) >= SMALLEST_OFFSET:
            self.offset = lag
            self._notes.append(
                f"[{name}] its stamps are {-lag * 1e3:.1f} ms late against the IMU's, by the "
                "motion of both: corrected"
            )
        else:
            self._notes.append(
                f"[{name}] its clock is the IMU's, within {SMALLEST_OFFSET * 1e3:g} ms"
            )
        half = len(one) // 2
        if mine is theirs and half * STEP > 10.0:
            parts = [
                best_lag(one[s], other[s], 20)[0] * STEP for s in (slice(half), slice(half, None))
            ]
            drift = (parts[0] - parts[1]) / (half * STEP)
            if abs(drift) * 2 * half * STEP > 0.02:
                self._notes.append(
                    f"[{name}] its clock drifts by {drift * 1e6:.0f} ppm against the IMU's; "
                    f"time_scale = {self._raw.rows.time_scale * (1.0 + drift):.7f} corrects it"
                )
