"""Truth and estimate of a recorded flight compared with its IMU: order, frames, units and clock."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from estimation.calibration import motion
from estimation.calibration.attitude_fit import AttitudeFit, fit_attitudes
from estimation.calibration.motion import (
    best_turn,
    common_grid,
    interpolated,
    joined,
    on_grid,
    speed,
)
from extensions.importers.attitude_fit import FITS, GRAVITY, angle_between, fit_order, nearest_body
from extensions.importers.flight import Track
from extensions.importers.frames import axes, quaternion_of
from extensions.importers.raw import RawTrack, ordered
from extensions.importers.rows import blocks, nanoseconds, turn
from extensions.importers.track_clock import SURE, TrackClock
from extensions.importers.trajectory import averaged, away_from_gaps, derivative, rates_of
from extensions.importers.units import LENGTH_UNITS, RATE_UNITS
from quadrotor.errors import LogFormatError, MeasurementError
from quadrotor.plain_rotations import matrices_of, product_of
from quadrotor.records import Array

CALM = 0.15
"""m/s² rms below which acceleration is too small to judge by."""
SLOW = 0.1
"""s between samples of an IMU by which no acceleration of a multicopter can be told."""
SLIGHT = (math.radians(0.2), math.radians(5.0))
"""Range of the angle, in rad, between the truth's and the IMU's body axes that is corrected: how
marker frames are mounted."""
MOST_POSES = 60_000
"""Largest number of poses that are fitted, evenly chosen: ten minutes at 100 Hz."""
ALIKE = 0.005
"""Difference of two correlations that tells nothing."""
WORLDS = ("ENU", "NED")


class Checked:
    """A track whose order, frames, units and clock are determined.

    Args:
        seconds, force, turning: of the IMU, FLU; (N,), (N, 3) m/s², (N, 3) in its own unit.
        notes: gets lines about what is found.
        check: whether it is compared with the IMU, or accepted as stated.
        estimate: the vehicle's estimate, by whose speed positions without attitude get their clock.

    Attributes:
        rate_scale: gyroscope reading per rad/s of this attitude; None if unknown.

    Raises LogFormatError.
    """

    def __init__(
        self,
        seconds: Array,
        force: Array,
        turning: Array,
        raw: RawTrack,
        notes: list[str],
        *,
        check: bool = True,
        estimate: RawTrack | None = None,
    ) -> None:
        self.raw = raw
        self.rate_scale: float | None = None
        self._seconds, self._force, self._turning = seconds, force, turning
        self._notes = notes
        self._clock = TrackClock(seconds, raw, notes)
        self._body = axes(raw.rows.body or "FLU", "body")
        self._world = axes(raw.rows.world or "ENU", "world")
        self._unit = self._stated_unit() or 1.0
        self._order: tuple[str, str] = (
            raw.rows.quaternion_order or "wxyz",
            raw.rows.quaternion_maps or "body to world",
        )
        if not check:
            return
        if raw.quaternion is not None:
            self._fit_attitude()
            self._fit_position()
        elif estimate is not None:
            self._fit_speed(estimate)
        else:
            self._fit_position_alone()

    def track(self, base_ns: int) -> Track:
        """Return the track in our frames, in the memory of the raw one, which is of no use any
        more; `base_ns` is when the IMU began.
        """
        raw, count = self.raw, len(self.raw.seconds)
        stamps = nanoseconds(self._clock.at, base_ns)
        turn(raw.position, self._unit * self._world)
        if raw.velocity is None:
            velocity = derivative(raw.seconds, raw.position)
        else:
            velocity = raw.velocity
            turn(velocity, self._unit * self._world)
        states = {"position_w": raw.position, "velocity_w": velocity}
        attitude_known = raw.quaternion is not None
        if not attitude_known:
            states["quaternion_wb"] = np.broadcast_to(math.nan, (count, 4))
            states["angular_velocity_b"] = np.broadcast_to(math.nan, (count, 3))
        else:
            turned = states["quaternion_wb"] = self._attitudes(slice(None))
            raw.quaternion = None
            for some in blocks(turned):
                turned[some] = product_of(quaternion_of(self._world), turned[some])
            states["angular_velocity_b"] = rates_of(raw.seconds, turned)
        return Track(raw.name, stamps, states, attitude_known)

    def _attitudes(self, rows: slice) -> Array:
        """Return the attitudes (N, 4) of the body FLU in the file's world."""
        assert self.raw.quaternion is not None
        found = ordered(self.raw.quaternion[rows], *self._order)
        for some in blocks(found):
            found[some] = product_of(found[some], quaternion_of(self._body.T))
        return found

    def _fit_attitude(self) -> None:
        """Determine order, clock and body from the rotation."""
        raw, rows = self.raw, self.raw.rows
        mine, theirs = self._clock.grids()
        imu = (self._seconds, self._force, self._turning)
        fit, tells = fit_order(
            raw,
            (mine, theirs),
            imu,
            lambda one, other: self._clock.lag(one, other, mine, theirs, same_axes=False),
            self._clock.offset,
        )
        self._order = fit.order, fit.way
        if not tells:
            self._notes.append(f"[{raw.name}] hardly turns: attitude and clock are not checked")
            return
        if rows.quaternion_order is None or rows.quaternion_maps is None:
            self._notes.append(f"[{raw.name}] quaternions are {fit.order}, {fit.way}")
        self.rate_scale = fit.turn.scale
        self._settle_body(fit.turn)
        gyro = on_grid(mine, self._seconds, self._turning)
        turned = fit.rate @ fit.turn.matrix.T * fit.turn.scale
        lag = self._clock.checked_lag(gyro, turned, mine, theirs)
        if (whole := self._whole_fit(fit.turn, lag)) is None:
            self._clock.settle(gyro, turned, mine, theirs)
            return
        self._correct_body(whole)
        self._clock.take(whole.delay, float(whole.deviations[0]))
        lasted = whole.at[-1] - whole.at[0]
        self._clock.tell_drift(whole.drift, float(whole.deviations[1]), lasted)

    def _whole_fit(self, turn: motion.Turn, lag: float) -> AttitudeFit | None:
        """Return clock, mounting and the gyroscope's bias, fitted together; None if the flight is
        too short for that.
        """
        some = slice(None, None, len(self.raw.seconds) // MOST_POSES + 1)
        stated = self._attitudes(some)
        scale = next((1.0 / k for k in RATE_UNITS.values() if 0.75 < turn.scale * k < 1.33), None)
        times, rate = averaged(self._seconds, self._turning)
        rate /= scale or turn.scale
        try:
            return fit_attitudes(times, rate, self._clock.at[some], stated, -lag, np.eye(3))
        except MeasurementError as error:
            self._notes.append(f"[{self.raw.name}] how its body is mounted is not checked: {error}")
            return None

    def _settle_body(self, turn: motion.Turn) -> None:
        raw = self.raw
        best = nearest_body(turn.matrix)
        if raw.rows.body is None:
            self._body = axes(best, "body")
            self._notes.append(f"[{raw.name}] its body is {best}, as the gyroscope turns")
        rest = math.degrees(angle_between(turn.matrix, self._body))
        if rest > 30.0:
            raise LogFormatError(
                f"[{raw.name}] its body is turned by {rest:.0f} deg against the IMU's, as both "
                f'turn: write body = "{best}", or is another body of the [imu] right?'
            )

    def _correct_body(self, fit: AttitudeFit) -> None:
        """Correct the truth's body by a slight turn that is surely not 0."""
        angle = float(fit.mount.magnitude())
        finding = (
            f"[{self.raw.name}] its body is turned by {math.degrees(angle):.2f} ± "
            f"{math.degrees(fit.turn_deviation):.2f} deg to the IMU's, as both turn"
        )
        sure = angle > SURE * fit.turn_deviation
        if self.raw.name == "truth" and sure and SLIGHT[0] < angle < SLIGHT[1]:
            self._body = fit.mount.as_matrix() @ self._body
            self._notes.append(f"{finding}: corrected")
        else:
            self._notes.append(finding)

    def _fit_position(self) -> None:
        """Determine world and unit of the positions from accelerations in the attitudes' world."""
        raw = self.raw
        assert raw.quaternion is not None
        at = self._clock.at
        grid = common_grid(self._seconds, at)
        turned = ordered(raw.quaternion, *self._order)
        turned = interpolated(grid, at, turned)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        force = interpolated(grid, self._seconds, self._force) @ self._body
        force = np.einsum("nij,nj->ni", matrices_of(turned), force)
        self._settle_world(force.mean(axis=0))
        gravity = self._world.T @ np.array([0.0, 0.0, GRAVITY])
        own = motion.smoothed(force - gravity, 2 * motion.SMOOTH)
        flown = motion.accelerations(
            motion.smoothed(interpolated(grid, at, raw.position), 2 * motion.SMOOTH)
        )
        inner = away_from_gaps(grid, at) & away_from_gaps(grid, self._seconds)
        own, flown = own[inner][50:-50], flown[inner][50:-50]
        if len(own) < 100 or math.sqrt(own.var(axis=0).sum()) < CALM:
            self._notes.append(f"[{raw.name}] too calm: its positions' world and unit not checked")
            return
        if np.median(np.diff(self._seconds)) > SLOW:
            self._notes.append(f"[{raw.name}] IMU too slow: its positions' world not checked")
            return
        turn = best_turn(flown - flown.mean(axis=0), own - own.mean(axis=0))
        share = math.sqrt(turn.explained)
        if share < FITS:
            raise LogFormatError(
                f"[{raw.name}] positions and specific force agree by {share:.2f} only (1: wholly): "
                "are they of one flight, in one world, and the columns in the right order?"
            )
        if turn.angle > 0.6:
            raise LogFormatError(
                f"[{raw.name}] the positions' world is turned by {math.degrees(turn.angle):.0f} "
                "deg against that of the quaternions: give both in one world"
            )
        self._settle_unit(turn.scale)

    def _settle_world(self, mean: Array) -> None:
        """Determine the attitudes' world, in which the mean specific force (3,) points up."""
        raw, rows = self.raw, self.raw.rows
        fits = [one for one in WORLDS if (axes(one, "") @ mean)[2] > 0.9 * np.linalg.norm(mean)]
        finding = f"[{raw.name}] turned by its attitude the mean specific force is " + (
            f"({', '.join(f'{one:.2f}' for one in mean)}) m/s^2"
        )
        if not fits:
            raise LogFormatError(
                f"{finding}: neither z up nor z down; is quaternion_maps right, "
                "and is [imu] body right?"
            )
        if rows.world is None:
            self._world = axes(fits[0], "world")
            self._notes.append(f"{finding}: its world is {fits[0]}")
        elif (self._world @ mean)[2] < 0.0:
            raise LogFormatError(f'{finding}: its world is not {rows.world}; write "{fits[0]}"')
        if abs(np.linalg.norm(mean) / GRAVITY - 1.0) > 0.05:
            self._notes.append(f"{finding}, not 9.81: the accelerometer's scale is off")

    def _fit_speed(self, estimate: RawTrack) -> None:
        """Determine the clock from the speed of the vehicle's estimate. Raises LogFormatError."""
        clock = self._clock
        shares = [(self._agreement(estimate, one), one) for one in clock.rates]
        best = max(shares)[0]
        share, clock.rate = min(  # the smallest drift of those that fit as well
            (one for one in shares if one[0] > best - ALIKE), key=lambda one: abs(one[1] - 1.0)
        )
        if share < FITS:
            raise LogFormatError(
                f"[{self.raw.name}] moves as the [estimate] by {share:.2f} only (1: wholly): "
                "are both of the same flight?"
            )
        self._notes.append(
            f"[{self.raw.name}] has no attitude: its clock is found by the speed of the [estimate]"
        )
        if clock.rate != 1.0:
            self._notes.append(
                f"[{self.raw.name}] its clock runs differently from the IMU's, by about "
                f"{1e6 * (clock.rate - 1.0):.0f} ppm: corrected, with the rest by the positions"
            )
        clock.settle(*self._speeds(estimate))

    def _agreement(self, estimate: RawTrack, rate: float) -> float:
        """Return the correlation of both speeds at a rate of the track's clock."""
        self._clock.rate = rate
        one, own, mine, theirs = self._speeds(estimate)
        lag = self._clock.lag(one, own, mine, theirs)
        mine_too, theirs_too = joined(mine, one, theirs + lag, own)
        return float(np.corrcoef(mine_too[:, 0], theirs_too[:, 0])[0, 1])

    def _speeds(self, estimate: RawTrack) -> tuple[Array, Array, Array, Array]:
        """Return the speeds of the estimate and of the track on their grids, and both grids.

        An estimate may be wrong for a while: it is never faster than the track ever is.
        """
        mine, theirs = self._clock.grids()
        one = speed(on_grid(mine, estimate.seconds, estimate.position))
        other = speed(on_grid(theirs, self._clock.at, self.raw.position))
        return np.minimum(one, other.max()), other, mine, theirs

    def _fit_position_alone(self) -> None:
        """Determine clock, unit and vertical of positions from the length of the specific force."""
        raw, rows = self.raw, self.raw.rows
        mine, theirs = self._clock.grids()
        force = np.linalg.norm(on_grid(mine, self._seconds, self._force), axis=1, keepdims=True)
        flown = motion.accelerations(on_grid(theirs, self._clock.at, raw.position))
        worlds = [rows.world] if rows.world else list(WORLDS)
        units = [self._stated_unit()] if rows.position_unit else [1.0, 1e-3]
        fits = []
        for world, unit in product(worlds, units):
            assert unit is not None
            wanted = unit * flown @ axes(world, "").T + np.array([0.0, 0.0, GRAVITY])
            own = np.linalg.norm(wanted, axis=1, keepdims=True)
            lag = self._clock.lag(force, own, mine, theirs)
            one, other = joined(mine, force, theirs + lag, own)
            share = float(np.corrcoef(one[:, 0], other[:, 0])[0, 1])
            fits.append((share, world, unit, own, float(np.std(own)), lag))
        share, world, self._unit, own, moved, _ = max(fits, key=lambda one: one[0])
        self._world = axes(world, "world")
        if moved < CALM or share < FITS:
            self._notes.append(
                f"[{raw.name}] its clock and world could not be checked: its positions are "
                f"accelerated as the specific force by {share:.2f} only (1: wholly)"
            )
            return
        if len(fits) > 1:
            self._notes.append(f"[{raw.name}] its world is {world}, its unit {self._unit:g} m")
        self._clock.settle(force, own, mine, theirs)

    def _stated_unit(self) -> float | None:
        stated = self.raw.rows.position_unit
        return LENGTH_UNITS[stated] if isinstance(stated, str) else stated

    def _settle_unit(self, scale: float) -> None:
        """Determine the unit; `scale` is m per unit, from the specific force."""
        name, stated = self.raw.name, self._stated_unit()
        found = next((k for k, unit in LENGTH_UNITS.items() if 0.6 < scale / unit < 1.6), None)
        finding = f"[{name}] positions move by {scale:.3g} m per unit, from the specific force"
        if stated is None:
            if found is None:
                raise LogFormatError(f"{finding}: no unit known here; write position_unit")
            self._unit = LENGTH_UNITS[found]
            if found != "m":
                self._notes.append(f"{finding}: in {found}")
            return
        if not 0.6 < scale / stated < 1.6:
            hint = f'write "{found}"' if found else "are these the right columns?"
            raise LogFormatError(f"{finding}, not in {self.raw.rows.position_unit}: {hint}")
        self._unit = stated
