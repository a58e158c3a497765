"""Bearings to beacons that are blinking LEDs, in the pictures of a camera on the vehicle.

A light shows a direction from the lens alone. Its distance, which the direction from the body's
origin needs, follows from the places of four beacons or more that are seen together; with fewer,
from the vehicle's estimated position, whose error matters little.
"""

from __future__ import annotations

import math

import numpy as np

from console.trackers.camera_figures import wrong_exposure
from console.trackers.source import Sighting
from extensions.vision.tags.beacon_markers import BeaconMarkers
from extensions.vision.tags.detector import Picture, check_size
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.lights import NYQUIST, LightTracks, Track, find_lights
from extensions.vision.tags.tag_bearings import LEAST, BearingReader, Places, TagBearings
from extensions.vision.tags.tag_pose import poses_of
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

NOISE = 0.1
"""Noise of a light's centre, pixels on each axis."""
NEAREST = 0.3
"""Least distance of an LED, m."""
ALIKE = 0.3
"""Largest difference of a light's blinks a second from those of its LED."""
ASTRAY = 0.2
"""Error of the vehicle's estimated position, m, that the deviation of a bearing allows for."""
MARK = 9.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Square around a light in a picture for people, pixels."""


class LedBearings(BearingReader):
    """Finds LEDs in consecutive pictures."""

    def __init__(self, markers: BeaconMarkers, lens: Intrinsics) -> None:
        super().__init__(markers, lens)
        self._tracks = LightTracks()
        self._sigma = math.hypot(NOISE / lens.matrix[0, 0], math.radians(markers.sigma))

    def take(
        self,
        grey: Picture,
        taken_ns: int = 0,
        places_w: Places | None = None,
        position_w: Array | None = None,
    ) -> Sighting:
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
        known = [k for k, number in enumerate(ids) if places_w and number in places_w]
        ids, pixels = [ids[k] for k in known], pixels[known]
        places = np.array([places_w[n] for n in ids] if places_w else [], float).reshape(-1, 3)
        far, sigma = self._distances(places, pixels), self._sigma
        if far is None and position_w is not None:
            far = np.maximum(np.linalg.norm(places - position_w, axis=1), NEAREST)
            lever = float(np.linalg.norm(self._lens_b))
            sigma = math.hypot(sigma, lever * ASTRAY / far.min(initial=math.inf) ** 2)
        if far is None or not ids:
            return Sighting([], np.empty((0, 3)), sigma, np.empty((0, 2)))
        places_b = self._lens_b + far[:, None] * (self._rays(pixels) @ self._R_bc.T)
        bearings_b = places_b / np.linalg.norm(places_b, axis=1)[:, None]
        return Sighting(ids, bearings_b, sigma, pixels)

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
                f"no LED is recognised, and {saturated} of {len(self._tracks.tracks)} lights are "
                "saturated: shorten the exposure"
            )
        return found

    def _check_rate(self, pictures: float) -> None:
        number = max(self._told.leds, key=self._told.leds.__getitem__)
        if self._told.leds[number] > NYQUIST * pictures:
            raise MeasurementError(
                f"LED {number} blinks {self._told.leds[number]:g} times a second, too fast for "
                f"{pictures:.0f} pictures a second: allowed are {NYQUIST * pictures:.1f}"
            )

    def _distances(self, places: Array, pixels: Array) -> Array | None:
        """Return the distances (N,) of beacons from the lens, m; None when too few show them."""
        poses = poses_of(places, pixels, self._lens) if len(places) >= LEAST else []
        if not poses:
            return None
        return np.asarray(np.linalg.norm(places @ poses[0].R_cb.T + poses[0].position_c, axis=1))

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
