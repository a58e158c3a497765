"""Rendered images of flat patterns (tags, a calibration board), as a real camera would take them.

Each pixel is the mean of rays through the lens onto the patterns, so that distortion, rolling
shutter and motion blur are as accurate as the rays. Camera axes: x right, y down in the picture,
z forward. Pixel (0, 0) is the centre of the first one. Distortion: D. C. Brown, "Close-range camera
calibration" (1971), in OpenCV's order k1, k2, p1, p2, k3.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from quadrotor.records import Array

Picture = npt.NDArray[np.uint8]
Box = tuple[slice, slice]
"""Rows and columns of a picture."""

NEAREST = 0.05
"""m in front of the camera; a pattern with a nearer corner is not drawn."""
INK = 0.06
"""Reflectance of black print; paper has 1."""
NO_TURN = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Pattern:
    """A flat picture in space: x right, y up in the picture, z out of its face, from its centre.

    Attributes:
        picture: (rows, columns) 0…255, seen from the front; size: (width, height), m.
        position_c: (3,) m; R_cp: (3, 3), the pattern's axes in camera axes; both at the middle of
            the exposure of the middle row.
        velocity_c: (3,) m/s; angular_velocity_c: (3,) rad/s; in camera axes.
    """

    picture: Picture
    size: tuple[float, float]
    position_c: Array
    R_cp: Array
    velocity_c: Sequence[float] | Array = NO_TURN
    angular_velocity_c: Sequence[float] | Array = NO_TURN


@dataclass(frozen=True, eq=False)
class RenderedCamera:
    """A camera that takes pictures of patterns in front of a plain background.

    Attributes:
        width, height: pixels. matrix: (3, 3) of focal lengths and principal point, pixels.
        distortion: (5,) k1, k2, p1, p2, k3.
        blur: of the lens, standard deviation in pixels. noise: standard deviation, grey levels.
        exposure: s for which each row is exposed. readout: s from the first row to the last.
        light: factor on the brightness; shade: relative change of brightness from the left edge to
            the right one. background: grey level.
        fine: rays per pixel along each axis.
    """

    width: int
    height: int
    matrix: Array
    distortion: Array = field(default_factory=lambda: np.zeros(5))
    blur: float = 0.6
    noise: float = 2.0
    exposure: float = 0.0
    readout: float = 0.0
    light: float = 1.0
    shade: float = 0.0
    background: float = 110.0
    fine: int = 4

    def project(self, points_c: Array) -> Array:
        """Return pixels (N, 2) of points (N, 3) m in camera axes, in front of the camera."""
        plane = _distorted(points_c[:, :2] / points_c[:, 2:], self.distortion)
        pixels: Array = plane * self.matrix[[0, 1], [0, 1]] + self.matrix[:2, 2]
        return pixels

    def take(self, patterns: Sequence[Pattern], random: np.random.Generator) -> Picture:
        """Return the picture (height, width); a later pattern hides earlier ones."""
        grey = np.full((self.height, self.width), self.background)
        drawn = [box for pattern in patterns if (box := self._draw(pattern, grey))]
        for box in _apart(drawn, round(3.0 * self.blur) + 1, grey.shape):
            grey[box] = _blurred(grey[box], self.blur)
        grey *= self.light * (1.0 + self.shade * np.linspace(-0.5, 0.5, self.width))
        grey += self.noise * random.standard_normal(grey.shape, dtype=np.float32)
        picture: Picture = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
        return picture

    def _draw(self, pattern: Pattern, grey: Array) -> Box | None:
        """Draw a pattern and return its bounding box; None when it is not in view."""
        width, height = pattern.size
        corners = np.array([[x, y, 0.0] for x in (-0.5, 0.5) for y in (-0.5, 0.5)])
        span = 0.5 * (self.exposure + self.readout)
        moved = [_moved(pattern, np.array(dt)) for dt in (-span, 0.0, span)]
        seen = np.concatenate([(corners * (width, height, 1.0) + (0, 0, 1)) @ H.T for H in moved])
        if seen[:, 2].min() < NEAREST or pattern.R_cp[:, 2] @ pattern.position_c >= 0.0:
            return None
        pixels = self.project(seen)
        limits = (self.width, self.height)
        left, top = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 1, 0, limits)
        right, bottom = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 2, 0, limits)
        if left >= right or top >= bottom:
            return None
        box = (slice(top, bottom), slice(left, right))
        lens = (tuple(map(tuple, self.matrix.tolist())), tuple(self.distortion.tolist()))
        rays, along_x, along_y = (one[box] for one in _rays(self.width, self.height, *lens))
        when = self.readout * ((np.arange(top, bottom) + 0.5) / self.height - 0.5)
        rows, columns = pattern.picture.shape
        total, hits, count = np.zeros(grey[box].shape), np.zeros(grey[box].shape), 0
        for x, y, dt in self._samples():
            into = np.linalg.inv(_moved(pattern, when + dt))[:, None]
            ray = rays + x * along_x + y * along_y
            on = np.einsum(
                "rcij,rcj->rci",
                np.broadcast_to(into, (*ray.shape[:2], 3, 3)),
                np.concatenate([ray, np.ones((*ray.shape[:2], 1))], axis=-1),
            )
            u = np.floor((on[..., 0] / on[..., 2] / width + 0.5) * columns).astype(int)
            v = np.floor((0.5 - on[..., 1] / on[..., 2] / height) * rows).astype(int)
            hit = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
            total[hit] += pattern.picture[v[hit], u[hit]]
            hits += hit
            count += 1
        total = INK * 255.0 * hits + (1.0 - INK) * total
        grey[box] = total / count + grey[box] * (1.0 - hits / count)
        return box

    def _samples(self) -> Iterator[tuple[float, float, float]]:
        """Yield positions in a pixel (pixels from its centre) and instants in its exposure (s)."""
        n = self.fine
        for i in range(n):
            for j in range(n):
                # No two in a row or column, and each instant once in each of n rows or columns.
                x, y = (i + (j + 0.5) / n) / n - 0.5, (j + (i + 0.5) / n) / n - 0.5
                yield x, y, self.exposure * (((i + j) % n + 0.5) / n - 0.5)


@lru_cache(maxsize=8)
def _rays(
    width: int, height: int, matrix: tuple[tuple[float, ...], ...], distortion: tuple[float, ...]
) -> tuple[Array, Array, Array]:
    """Return (height, width, 2): each pixel's ray at distance 1, and its change per column and row.

    Cameras with the same lens share it, because it takes longer than a picture.
    """
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    pixels = np.stack([columns, rows], axis=-1).astype(float)
    (fx, _, cx), (_, fy, cy), _ = matrix
    wanted = (pixels - np.array([cx, cy])) / np.array([fx, fy])
    rays = wanted.copy()
    for _ in range(20):
        rays += wanted - _distorted(rays, distortion)
    down, right = np.gradient(rays, axis=(0, 1))
    return rays, right, down


def _distorted(plane: Array, distortion: Sequence[float] | Array) -> Array:
    """Return where the lens maps points (…, 2) of the plane at distance 1."""
    k1, k2, p1, p2, k3 = distortion
    x, y = plane[..., 0], plane[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        ],
        axis=-1,
    )


def _moved(pattern: Pattern, dt: Array) -> Array:
    """Return (…, 3, 3): (x, y, 1) on the pattern to camera axes, dt (…) s later, first order."""
    at = np.column_stack([pattern.R_cp[:, :2], pattern.position_c])
    turning = np.cross(pattern.angular_velocity_c, pattern.R_cp[:, :2].T).T
    rate = np.column_stack([turning, pattern.velocity_c])
    moved: Array = at + dt[..., None, None] * rate
    return moved


def _apart(boxes: Sequence[Box], rim: int, shape: tuple[int, ...]) -> list[Box]:
    """Return the boxes with a margin around them, overlapping ones merged; the rest of the picture
    is plain and unchanged by a blur.
    """
    found: list[Box] = []
    for box in boxes:
        rows, columns = (
            slice(max(0, along.start - rim), min(size, along.stop + rim))
            for along, size in zip(box, shape, strict=True)
        )
        while met := [one for one in found if _meet(one[0], rows) and _meet(one[1], columns)]:
            found.remove(met[0])
            rows, columns = _around(met[0][0], rows), _around(met[0][1], columns)
        found.append((rows, columns))
    return found


def _meet(one: slice, other: slice) -> bool:
    return bool(one.start < other.stop and other.start < one.stop)


def _around(one: slice, other: slice) -> slice:
    return slice(min(one.start, other.start), max(one.stop, other.stop))


def _blurred(grey: Array, sigma: float) -> Array:
    """Return a picture blurred by a Gaussian of so many pixels."""
    if sigma <= 0.0:
        return grey
    reach = max(1, round(3.0 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        pad = [(reach, reach) if one == axis else (0, 0) for one in (0, 1)]
        wide = np.pad(grey, pad, mode="edge")
        length = grey.shape[axis]
        parts = [np.take(wide, range(k, k + length), axis) for k in range(2 * reach + 1)]
        grey = np.tensordot(weights, np.stack(parts), axes=1)
    return grey
