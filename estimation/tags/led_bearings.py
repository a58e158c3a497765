"""Bearings to beacons that are blinking LEDs, in the pictures of a camera on the vehicle.

A light shows a direction from the lens alone. Its distance, which the direction from the body's
origin needs, follows from the places of four beacons or more that are seen together.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.tags.beacon_markers import BeaconMarkers
from estimation.tags.detector import Picture, check_size, wrong_exposure
from estimation.tags.intrinsics import Intrinsics
from estimation.tags.lights import NYQUIST, LightTracks, Track, find_lights
from estimation.tags.tag_bearings import LEAST, BearingReader, Places, Sighting, TagBearings
from estimation.tags.tag_pose import TagPose, poses_of
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

NOISE = 0.1
"""Noise of a light's centre, pixels on each axis."""
ALIKE = 0.3
"""Largest difference of a light's blinks a second from those of its LED."""
REMEMBERED, FORGOTTEN = 1.0, 5.0
"""Seconds for which a pose, and a distance, is used while fewer beacons are seen."""
SPEED = 1.0
"""Speed at which a remembered distance may change, m/s."""
ENOUGH = 3
"""Beacons that show a pose near the last one; the first pose needs LEAST."""
MARK = 9.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Square around a light in a picture for people, pixels."""


class LedBearings(BearingReader):
    """Finds LEDs in consecutive pictures."""

    def __init__(self, markers: BeaconMarkers, lens: Intrinsics) -> None:
        super().__init__(markers, lens)
        self._tracks = LightTracks()
        self._far: dict[int, tuple[float, float]] = {}  # s, and m from the lens
        self._pose: TagPose | None = None  # of the layout of the beacons
        self._pose_at = 0.0
        self._sigma = math.hypot(NOISE / lens.matrix[0, 0], math.radians(markers.sigma))

    def take(self, grey: Picture, taken_ns: int = 0, places_w: Places | None = None) -> Sighting:
        self.tags, self.doubt, at = {}, "", 1e-9 * taken_ns
        check_size(grey, self._lens)
        if wrong_exposure(mean := float(grey.mean())) == "white":
            raise MeasurementError(
                f"the picture is white (mean grey level {mean:.0f} of 255): shorten the exposure"
            )
        self._tracks.take(find_lights(grey), at)
        found = self._identified()
        ids = sorted(found)
        pixels = np.array([found[number].light.pixel for number in ids]).reshape(-1, 2)
        self.tags = {number: pixel + MARK for number, pixel in zip(ids, pixels, strict=True)}
        self._measure(ids, pixels, places_w or {}, at)
        known = [k for k, number in enumerate(ids) if number in self._far]
        if not known:
            return Sighting([], np.empty((0, 3)), self._sigma, np.empty((0, 2)))
        since, far = np.array([self._far[ids[k]] for k in known]).T
        doubt = float((SPEED * (at - since) / far**2).max() * np.linalg.norm(self._lens_b))
        places_b = self._lens_b + far[:, None] * (self._rays(pixels[known]) @ self._R_bc.T)
        return Sighting(
            [ids[k] for k in known],
            places_b / np.linalg.norm(places_b, axis=1)[:, None],
            math.hypot(self._sigma, doubt),
            pixels[known],
        )

    def _identified(self) -> dict[int, Track]:
        found: dict[int, Track] = {}
        saturated = 0
        for track in self._tracks.tracks:
            rate, pictures = track.rate
            saturated += bool(pictures) and not rate and track.light.is_saturated
            if pictures:
                self._check_rate(pictures)
            if not rate:
                continue
            number = min(self._told.leds, key=lambda n: abs(self._told.leds[n] - rate))
            if abs(self._told.leds[number] - rate) > ALIKE:
                self.doubt = (
                    f"a light blinks {rate:.1f} times a second, and no LED of the file does; add "
                    "it to [leds], or cover it"
                )
            elif number in found:
                raise MeasurementError(
                    f"LED {number} is seen twice: cover its reflection, or let the other one blink "
                    f"at another rate than {self._told.leds[number]:g} times a second"
                )
            else:
                found[number] = track
        if saturated and not found:
            raise MeasurementError(
                f"no LED is recognised, and {saturated} lights are saturated: shorten the exposure"
            )
        return found

    def _check_rate(self, pictures: float) -> None:
        number = max(self._told.leds, key=self._told.leds.__getitem__)
        if self._told.leds[number] > NYQUIST * pictures:
            raise MeasurementError(
                f"LED {number} blinks {self._told.leds[number]:g} times a second, too fast for "
                f"{pictures:.0f} pictures a second: allowed are {NYQUIST * pictures:.1f}"
            )

    def _measure(self, ids: list[int], pixels: Array, places_w: Places, at: float) -> None:
        """Note the distances of LEDs from the lens, and forget old ones."""
        placed = [k for k, number in enumerate(ids) if number in places_w]
        if len(placed) >= ENOUGH:
            places = np.array([places_w[ids[k]] for k in placed], float)
            for k, far in zip(placed, self._distances(places, pixels[placed], at), strict=False):
                self._far[ids[k]] = at, far
        self._far = {n: one for n, one in self._far.items() if 0.0 <= at - one[0] <= FORGOTTEN}

    def _distances(self, places: Array, pixels: Array, at: float) -> list[float]:
        """Return the distances of beacons from the lens, m; none when they do not show them."""
        recent = 0.0 <= at - self._pose_at <= REMEMBERED
        if len(places) < LEAST and not (recent and self._pose):
            return []
        start = self._pose if len(places) < LEAST else None
        pose = next(iter(poses_of(places, pixels, self._lens, start)), None)
        self._pose, self._pose_at = pose, at
        if pose is None:
            return []
        off = places @ pose.R_cb.T + pose.position_c
        return [float(far) for far in np.linalg.norm(off, axis=1)]

    def _rays(self, pixels: Array) -> Array:
        """Return unit vectors (N, 3) in camera axes."""
        import cv2

        K, distortion = self._lens.matrix, self._lens.distortion
        plane = cv2.undistortPoints(pixels[:, None], K, distortion)[:, 0]
        rays = np.column_stack([plane, np.ones(len(plane))])
        found: Array = rays / np.linalg.norm(rays, axis=1)[:, None]
        return found


def bearing_reader(markers: BeaconMarkers, lens: Intrinsics) -> BearingReader:
    """Return the reader of tags or LEDs. Raises MeasurementError for an unknown family."""
    return LedBearings(markers, lens) if markers.leds else TagBearings(markers, lens)
