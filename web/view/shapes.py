"""Geometry of beacons in the 3D view: meshes and rotations.

Quaternions are (w, x, y, z); lengths in m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from viser.transforms import SO3

from quadrotor.plain_rotations import rows_of
from vehicle_link.messages import records

Array = npt.NDArray[np.float64]
Point = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Mesh = tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]
"""Vertices (V, 3) and faces (F, 3)."""

DEVIATIONS = 3.0
"""Size of cones and ellipsoids, in standard deviations."""
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


def point_of(v: records.Vector3 | records.Point) -> Point:
    """Return the point of a message with x, y, z."""
    return (v.x, v.y, v.z)


def wxyz_of(q: records.Quaternion) -> Quaternion:
    """Return the (w, x, y, z) of a geometry_msgs/Quaternion."""
    return (q.w, q.x, q.y, q.z)


def matrix_of(q: Sequence[float]) -> Array:
    """Return the rotation matrix of a quaternion of any length except zero."""
    return np.array(rows_of(np.asarray(q, float) / math.sqrt(math.fsum(c * c for c in q))))


def turns_from_z(directions: Array) -> Array:
    """Return quaternions (N, 4) of the shortest rotations from +z to unit vectors (N, 3)."""
    x, y, z = directions.T
    w = 1.0 + z
    q = np.stack([w, -y, x, np.zeros_like(w)], axis=1)
    q[w < 1e-9] = (0.0, 1.0, 0.0, 0.0)  # straight down: half a turn about x
    turns: Array = q / np.linalg.norm(q, axis=1)[:, None]
    return turns


def cone(segments: int = 28) -> Mesh:
    """Return the lateral surface of a cone: apex at the origin, base of radius 1 at z = 1."""
    angle = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), np.ones(segments)], axis=1)
    k = np.arange(segments)
    faces = np.stack([np.zeros(segments), 1 + (k + 1) % segments, 1 + k], axis=1)
    return np.vstack([np.zeros(3), rim]).astype(np.float32), faces.astype(np.uint32)


def cone_scales(distances: Array, sigma: float) -> Array:
    """Return the scales (N, 3) with which `cone()` reaches beacons, `DEVIATIONS` sigma wide.

    Args:
        distances: distances to the beacons, m.
        sigma: rad on each of two tangent axes.
    """
    angle = min(DEVIATIONS * sigma, math.radians(80.0))
    radius = distances * math.tan(angle)
    return np.stack([radius, radius, distances], axis=1)


def ellipsoid(covariance: npt.ArrayLike) -> tuple[Point, Quaternion] | None:
    """Return half axes (m) and rotation of the ellipsoid of a (3, 3) covariance (m^2).

    Its surface is at `DEVIATIONS` standard deviations. None if the covariance is not finite or not
    positive definite.
    """
    P = np.asarray(covariance, float).reshape(3, 3)
    if not np.isfinite(P).all():
        return None
    variances, axes = np.linalg.eigh(0.5 * (P + P.T))
    if not variances[0] > 0.0:
        return None
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    x, y, z = (DEVIATIONS * math.sqrt(v) for v in variances.tolist())
    w, i, j, k = SO3.from_matrix(axes).wxyz.tolist()
    return (x, y, z), (w, i, j, k)


def handle(radius: float = 0.17, reach: float = 0.27) -> Mesh:
    """Return the handle that drags a beacon.

    It is a disc in the plane z = 0 with an arrow head on each of four sides.
    """
    segments = 32
    angle = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    vertices = [(0.0, 0.0, 0.0)]
    vertices += [(radius * math.cos(a), radius * math.sin(a), 0.0) for a in angle.tolist()]
    faces = [(0, 1 + k, 1 + (k + 1) % segments) for k in range(segments)]
    for quarter in range(4):
        c, s = math.cos(0.5 * math.pi * quarter), math.sin(0.5 * math.pi * quarter)
        base = len(vertices)
        for along, across in ((reach, 0.0), (radius + 0.03, 0.06), (radius + 0.03, -0.06)):
            vertices.append((c * along - s * across, s * along + c * across, 0.0))
        faces.append((base, base + 1, base + 2))
    return np.array(vertices, np.float32), np.array(faces, np.uint32)


def on_plane(eye: Point, through: Point, point: Point, normal: Point) -> Point | None:
    """Return where the line of sight from `eye` through another point meets a plane.

    None if it does not, or at so flat an angle that one pixel means metres.
    """
    ray = [b - a for a, b in zip(eye, through, strict=True)]
    length = math.sqrt(math.fsum(c * c for c in ray))
    if not 0.0 < length < math.inf:
        return None
    toward = math.fsum(n * c for n, c in zip(normal, ray, strict=True)) / length
    if abs(toward) < 0.03:
        return None
    away = math.fsum(n * (p - e) for n, p, e in zip(normal, point, eye, strict=True))
    share = away / toward / length
    if not share > 0.0:
        return None
    x, y, z = (e + share * c for e, c in zip(eye, ray, strict=True))
    return (x, y, z)


def along_axis(eye: Point, through: Point, place: Point, axis: int) -> Point | None:
    """Return the point of the axis through `place` that is closest to a line of sight, seen from
    `eye`; None where the line of sight is nearly parallel to it.
    """
    toward = [e - p for e, p in zip(eye, place, strict=True)]
    toward[axis] = 0.0
    length = math.sqrt(math.fsum(c * c for c in toward))
    if length < 1e-6:
        return None
    x, y, z = (c / length for c in toward)
    met = on_plane(eye, through, place, (x, y, z))
    if met is None:
        return None
    moved = list(place)
    moved[axis] = met[axis]
    return (moved[0], moved[1], moved[2])


def distance_to_ray(eye: Point, through: Point, point: Point) -> float:
    """Return the distance of a point from the line of sight from `eye` through another, m."""
    ray = np.subtract(through, eye)
    away = np.subtract(point, eye)
    return float(np.linalg.norm(np.cross(ray, away)) / np.linalg.norm(ray))


def cones(radius: float = 0.06, start: float = 0.17, end: float = 0.32) -> Mesh:
    """Return the handle that moves along z: two cones, which point up and down from a gap."""
    vertices, faces = cone(20)
    vertices = vertices * np.array([radius, radius, start - end], np.float32)
    up = vertices + np.array([0.0, 0.0, end], np.float32)
    down = up * np.array([1.0, 1.0, -1.0], np.float32)
    return np.vstack([up, down]), np.vstack([faces, faces + len(up)]).astype(np.uint32)
