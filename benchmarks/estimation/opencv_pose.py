"""The pose from bearings by OpenCV's planar solvers, for comparison with `planar_pose`.

G. Terzakis and M. Lourakis, "A consistently fast and globally optimal solution to the
perspective-n-point problem" (2020), SQPNP; T. Collins and A. Bartoli, "Infinitesimal plane-based
pose estimation" (2014), IPPE. Both need image points, so a bearing must lie in front of a camera:
its axis is the body's downward axis, or the bearings' mean direction, which leaves fewer behind it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from estimation.poses.beacon_plane import BeaconPlane
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

BEHIND = 0.01
"""Cosine to the camera's axis below which a bearing has no image point."""
DOWNWARD = np.diag([1.0, -1.0, -1.0])
"""Rows: the axes, in body axes, of a camera that looks down."""


class OpenCVPose:
    """One of OpenCV's solvers on one set of beacons.

    Args:
        beacons_w: (N, 3) m, as for `BeaconPlane.of`, whose errors are raised.
        method: "SQPNP" or "IPPE".
        polish: "", "LM" or "VVS", OpenCV's refinements.
        aimed: whether the camera looks along the bearings' mean instead of downward.
    """

    def __init__(
        self, beacons_w: npt.ArrayLike, method: str, polish: str = "", aimed: bool = False
    ) -> None:
        import cv2

        self._plane = plane = BeaconPlane.of(beacons_w)
        # IPPE needs the points at height 0 of their own axes.
        self._points = (plane.beacons_w - plane.center_w) @ plane.axes.T
        self._points[:, 2] = 0.0
        self._flag: int = {"SQPNP": cv2.SOLVEPNP_SQPNP, "IPPE": cv2.SOLVEPNP_IPPE}[method]
        self._solve: Any = cv2.solvePnP
        refinements = {"": None, "LM": cv2.solvePnPRefineLM, "VVS": cv2.solvePnPRefineVVS}
        self._polish: Any = refinements[polish]
        self._rodrigues: Any = cv2.Rodrigues
        self._aimed = aimed
        self._camera = np.eye(3)
        self._no_lens = np.zeros(4)

    def solve(self, bearings_b: Array) -> tuple[Array, Array]:
        """Return position_w (3,) m and R_wb (3, 3) from (N, 3) unit vectors in body axes.

        Raises DegenerateGeometryError when a bearing is behind the camera, MeasurementError when
        the solver finds no pose.
        """
        R_cb = _aimed_along(bearings_b.sum(axis=0)) if self._aimed else DOWNWARD
        seen = bearings_b @ R_cb.T
        if seen[:, 2].min() < BEHIND:
            raise DegenerateGeometryError(
                "a bearing is 90 degrees or more off the camera's axis and has no image point; "
                "use planar_pose, which takes bearings in any direction"
            )
        image = np.ascontiguousarray(seen[:, :2] / seen[:, 2:])
        found, turn, t = self._solve(
            self._points, image, self._camera, self._no_lens, flags=self._flag
        )
        if found and self._polish is not None:
            turn, t = self._polish(self._points, image, self._camera, self._no_lens, turn, t)
        if not found or not math.isfinite(float(turn.sum() + t.sum())):
            raise MeasurementError("OpenCV found no pose; check the beacons' identities")
        R_cp = self._rodrigues(turn)[0]  # plane axes to camera axes
        plane = self._plane
        position: Array = plane.center_w - plane.axes.T @ (R_cp.T @ t[:, 0])
        R_wb: Array = plane.axes.T @ R_cp.T @ R_cb
        return position, R_wb


def _aimed_along(direction_b: Array) -> Array:
    """Return the axes, as rows, of a camera that looks along a direction of the body."""
    z = direction_b / math.sqrt(float(direction_b @ direction_b))
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= math.sqrt(float(x @ x))
    return np.stack([x, np.cross(z, x), z])
