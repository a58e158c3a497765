"""Small lights in a grey picture, and which of them blinks how often.

A light stays visible: it blinks between dim and bright. So it is followed from picture to picture,
and its blinks are counted in the brightness of a second of pictures, whatever their phase: neither
the LEDs nor the camera need to be synchronised. Steady lights and reflections of lamps are ignored.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np

from extensions.vision.tags.detector import Picture
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

CONTRAST = 40.0
"""Grey levels above the picture's median from which a pixel belongs to a light."""
SMALLEST, LARGEST = 3, 400
"""Pixels of a light; larger ones are lamps and windows."""
MOST = 64
"""Lights in a picture beyond which it is unusable."""
RIM = 2
"""Pixels around a light that are used for its centre."""
FAINT = 0.1
"""Share of the brightest pixel from which a pixel is used."""
FULL = 255
"""Grey level of a saturated pixel."""

WINDOW = 1.0
"""Seconds over which blinks are counted."""
GATE = 30.0
"""Pixels within which a light is searched around its predicted place."""
ALONE = 2.0
"""Least ratio of the distances of the second nearest and the nearest light."""
UNSEEN = 0.1
"""Seconds after which a light that is not seen is forgotten."""
FLICKER = 0.1
"""Deviation of the logarithm of the brightness up to which a light is steady."""
CLEAR = 0.6
"""Share of the variance of the brightness that a clear blink explains; a square wave has 0.81."""
SLOWEST, FINENESS = 1.0, 0.1
"""Lowest rate that is searched and the distance of two, Hz."""
NYQUIST = 0.45
"""Fastest blink, in blinks per picture; faster ones look like slower ones."""


class Light(NamedTuple):
    """A light in a picture: its centre (2,), pixels; its brightness, grey levels times pixels; and
    whether pixels of it are saturated.
    """

    pixel: Array
    brightness: float
    is_saturated: bool


def find_lights(grey: Picture) -> list[Light]:
    """Return the small lights in a picture. Raises MeasurementError when there are too many."""
    import cv2

    bright = float(np.median(grey[::4, ::4])) + CONTRAST
    _, labels, boxes, _ = cv2.connectedComponentsWithStats((grey > bright).astype(np.uint8))
    lit = boxes[:, cv2.CC_STAT_AREA]
    begin, end = boxes[:, :2] - RIM, boxes[:, :2] + boxes[:, 2:4] + RIM
    # The part that is seen of a light at the edge has another centre.
    is_whole = np.all((begin >= 0) & (end <= grey.shape[::-1]), axis=1)
    small = np.flatnonzero((lit >= SMALLEST) & (lit <= LARGEST) & is_whole)
    small = small[small > 0]  # 0 is the background
    if len(small) > MOST:
        raise MeasurementError(
            f"{len(small)} lights are in the picture, allowed {MOST}: shorten the exposure until "
            "only the LEDs are bright"
        )
    return [_light(grey, labels, k, begin[k], end[k]) for k in small.tolist()]


def _light(grey: Picture, labels: Any, label: int, begin: Array, end: Array) -> Light:
    (left, top), (right, bottom) = begin, end
    seen = grey[top:bottom, left:right].astype(float)
    own = labels[top:bottom, left:right]
    edge = np.concatenate([seen[0], seen[-1], seen[1:-1, 0], seen[1:-1, -1]])
    above = seen - np.median(edge)
    above[(above < FAINT * above.max()) | ((own != label) & (own != 0))] = 0.0
    total = above.sum()
    rows, columns = np.indices(above.shape)
    centre = np.array([(above * columns).sum() / total + left, (above * rows).sum() / total + top])
    return Light(centre, float(total), bool((seen[own == label] == FULL).sum() >= SMALLEST))


class Track:
    """A light that is followed from picture to picture.

    Attributes:
        light: as last seen. seen_at: s.
    """

    def __init__(self, light: Light, at: float) -> None:
        self.light, self.seen_at = light, at
        self._velocity = np.zeros(2)
        self._history: deque[tuple[float, float]] = deque([(at, light.brightness)])

    def predicted(self, at: float) -> Array:
        """Return where it should be at a time, pixels."""
        place: Array = self.light.pixel + (at - self.seen_at) * self._velocity
        return place

    def add(self, light: Light, at: float) -> None:
        self._velocity = (light.pixel - self.light.pixel) / (at - self.seen_at)
        self.light, self.seen_at = light, at
        self._history.append((at, light.brightness))
        while at - self._history[0][0] > WINDOW:
            self._history.popleft()

    @property
    def rate(self) -> tuple[float, float]:
        """Return its blinks a second and the pictures a second; (0, 0) while it was not seen for
        long enough, and no blinks of a steady light.
        """
        times, brightness = np.array(self._history).T
        times = times - times[0]
        if len(times) < 3 or times[-1] < 0.9 * WINDOW:
            return 0.0, 0.0
        level = np.log(brightness)
        level -= np.polyval(np.polyfit(times, level, 1), times)  # it comes nearer, or goes
        pictures = float((len(times) - 1) / times[-1])
        if level.std() < FLICKER:
            return 0.0, pictures
        rates = np.arange(SLOWEST, 0.5 * pictures, FINENESS)
        waves = np.exp(-2j * np.pi * np.outer(rates, times)) @ level
        share = 2.0 * np.abs(waves) ** 2 / (len(times) * float(level @ level))
        best = int(share.argmax())
        return float(rates[best]) if share[best] > CLEAR else 0.0, pictures


class LightTracks:
    """Follows all lights of a camera.

    Attributes:
        tracks: those seen in the newest picture.
    """

    def __init__(self) -> None:
        self.tracks: list[Track] = []
        self._all: list[Track] = []

    def take(self, lights: list[Light], at: float) -> None:
        """Handle the lights of a picture taken at a time, s. A light that may be either of two is
        followed no longer.
        """
        if self._all and at <= max(track.seen_at for track in self._all):
            self._all.clear()  # the clock was set
        self._all = [track for track in self._all if at - track.seen_at <= UNSEEN]
        there = np.array([light.pixel for light in lights]).reshape(-1, 1, 2)
        wanted = np.array([track.predicted(at) for track in self._all]).reshape(1, -1, 2)
        apart = np.linalg.norm(there - wanted, axis=2)
        free = set(range(len(lights)))
        kept, self.tracks = [], []
        for k, track in enumerate(self._all):
            order = np.argsort(apart[:, k])[:2]
            near = [int(n) for n in order if apart[n, k] < GATE]
            if not near:
                kept.append(track)
            elif apart[near[0]].argmin() == k and (
                len(near) == 1 or apart[near[1], k] > ALONE * apart[near[0], k]
            ):
                track.add(lights[near[0]], at)
                free.discard(near[0])
                self.tracks.append(track)
        self.tracks += [Track(lights[n], at) for n in sorted(free)]
        self._all = [*kept, *self.tracks]
