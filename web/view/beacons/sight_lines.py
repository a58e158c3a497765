"""The vehicle's sight of the beacons: measured rays, and three-sigma cones to the beacons.

A ray starts at the pose at which its bearing was measured, in the measured direction, and is as
long as the distance to the beacon: its end misses the beacon by the noise. A cone points at the
beacon itself, so that it is steady; a ray outside of it is one in ninety. The pose is the truth if
available, else the vehicle's estimate.
"""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from vehicle_link.messages import stamp_of
from vehicle_link.messages.records import BearingArray, Odometry
from web.view.lines import line_color
from web.view.shapes import (
    Array,
    Point,
    Quaternion,
    cone,
    cone_scales,
    matrix_of,
    point_of,
    turns_from_z,
    wxyz_of,
)

if TYPE_CHECKING:
    from viser import SceneApi

RATE = 15.0  # largest rate, Hz
HISTORY = 2.0  # s
COLOR = (224, 196, 110)
CONE_OPACITY = 0.07
MOVED = 0.004  # m; a cone is not redrawn for a smaller move


class PoseHistory:
    """Last poses of one source (`truth` or `state`), interpolated at a stamp."""

    def __init__(self) -> None:
        self._source = ""
        self._poses: deque[tuple[int, Point, Quaternion]] = deque()

    def add(self, source: str, message: Odometry) -> None:
        """Add an odometry; another source or an earlier stamp clears the history first."""
        stamp_ns = stamp_of(message)
        if source != self._source or (self._poses and stamp_ns < self._poses[-1][0]):
            self._poses.clear()
            self._source = source
        if self._poses and stamp_ns == self._poses[-1][0]:
            return
        pose = message.pose.pose
        self._poses.append((stamp_ns, point_of(pose.position), wxyz_of(pose.orientation)))
        while stamp_ns - self._poses[0][0] > 1e9 * HISTORY:
            self._poses.popleft()

    def clear(self) -> None:
        self._poses.clear()

    def at(self, stamp_ns: int) -> tuple[Array, Array] | None:
        """Return position (3,) m and R_wb (3, 3), interpolated, or None if the history is empty.

        Beyond the history, the pose at its nearest end is returned.
        """
        if not self._poses:
            return None
        later = self._poses[-1]
        if stamp_ns >= later[0]:
            return np.array(later[1]), matrix_of(later[2])
        for k in range(len(self._poses) - 2, -1, -1):
            earlier, later = self._poses[k], self._poses[k + 1]
            if earlier[0] <= stamp_ns:
                break
        else:
            first = self._poses[0]
            return np.array(first[1]), matrix_of(first[2])
        share = (stamp_ns - earlier[0]) / (later[0] - earlier[0])
        p, q = np.array(earlier[1]), np.array(earlier[2])
        to_p, to_q = np.array(later[1]), np.array(later[2])
        to_q = math.copysign(1.0, float(q @ to_q)) * to_q
        return p + share * (to_p - p), matrix_of((q + share * (to_q - q)).tolist())


class SightLines:
    """Nodes `/rays` and `/cones`."""

    def __init__(self, api: SceneApi) -> None:
        self._rays = api.add_line_segments(
            "/rays",
            np.zeros((4, 2, 3), np.float32),
            line_color(COLOR),
            thickness=1.5,
            thickness_units="screen",
            visible=False,
        )
        self._cones = api.add_batched_meshes_simple(
            "/cones",
            *cone(),
            batched_wxyzs=np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (4, 1)),
            batched_positions=np.zeros((4, 3), np.float32),
            batched_scales=np.full((4, 3), 1e-4, np.float32),
            batched_colors=COLOR,
            opacity=CONE_OPACITY,
            side="double",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._apex = np.full(3, np.inf)
        self._base = np.zeros((0, 3))
        self._sigma = 0.0

    def hide(self) -> None:
        self._rays.visible = False
        self._cones.visible = False

    def show(
        self,
        frame: BearingArray,
        pose: tuple[Array, Array],
        places: dict[int, Point],
        *,
        rays: bool,
        cones: bool,
    ) -> None:
        """Show one BearingArray, measured at this pose (position and R_wb)."""
        position, R_wb = pose
        given = dict(zip(map(int, frame.beacon_ids), frame.bearings, strict=False))
        ids = [id for id in given if id in places]
        beacons = np.array([places[id] for id in ids]).reshape(-1, 3)
        directions = np.array([point_of(given[id]) for id in ids]).reshape(-1, 3) @ R_wb.T
        sound = bool(ids and np.isfinite(directions).all() and np.isfinite(position).all())
        if sound and rays:
            self._draw_rays(position, directions, beacons, len(places))
        if sound and cones:
            self._draw_cones(position, beacons, float(frame.sigma), len(places))
        self._rays.visible = sound and rays
        self._cones.visible = sound and cones

    def _draw_rays(self, apex: Array, directions: Array, beacons: Array, count: int) -> None:
        """Draw `count` segments, however many are seen: a node of constant size is cheap."""
        distances = np.linalg.norm(beacons - apex, axis=1)
        segments = np.empty((count, 2, 3), np.float32)
        segments[:] = apex
        segments[: len(beacons), 1] = apex + distances[:, None] * directions
        self._rays.points = segments

    def _draw_cones(self, apex: Array, beacons: Array, sigma: float, count: int) -> None:
        is_same = beacons.shape == self._base.shape and sigma == self._sigma
        if is_same and count == len(self._cones.batched_positions):
            moved = max(np.abs(apex - self._apex).max(), np.abs(beacons - self._base).max())
            if moved < MOVED:
                return
        self._apex, self._base, self._sigma = apex.copy(), beacons, sigma
        rays = beacons - apex
        distances = np.maximum(np.linalg.norm(rays, axis=1), 1e-6)
        turns = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (count, 1))
        scales = np.full((count, 3), 1e-4)  # hides the cones of beacons not seen
        turns[: len(beacons)] = turns_from_z(rays / distances[:, None])
        scales[: len(beacons)] = cone_scales(distances, sigma)
        # Do not set the node's own position: the browser would move it a frame before the others.
        self._cones.batched_positions = np.tile(apex, (count, 1)).astype(np.float32)
        self._cones.batched_wxyzs = turns.astype(np.float32)
        self._cones.batched_scales = scales.astype(np.float32)
