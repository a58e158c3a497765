"""Pose of the body from one frame of bearings to at least four coplanar beacons (Sec. 6.2).

The homography of four beacons gives a start (`homography`); Gauss-Newton steps on all bearings,
usually two, make the estimate efficient (`bearing_refinement`). Bearings may point anywhere on the
sphere. Everything that depends on the beacons alone is prepared once (`beacon_plane`); a frame is
one call of compiled code.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from estimation.poses.beacon_plane import BeaconPlane
from estimation.poses.bearing_frame import ATTITUDE, CENTER, PLANE, POSITION, SIGHTS
from estimation.poses.frame_solution import (
    BAD_PREDICTION,
    BAD_SIGMA,
    DOUBTFUL,
    MAX_STEPS,
    NO_FIT,
    NO_START,
    NOT_FINITE,
    NOT_UNIT,
    SHAPE,
    SOLVED,
    UNIT,
    chi_square,
    solve_frame,
)
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

_preparing = threading.Lock()


class PlanarPose:
    """A pose from one frame; its arrays are views of one."""

    __slots__ = ("_frame",)

    def __init__(self, frame: Array) -> None:
        self._frame = frame

    @property
    def position_w(self) -> Array:
        """Return the position (3,) in m."""
        return self._frame[POSITION, :3]

    @property
    def quaternion_wb(self) -> Array:
        """Return the attitude (4,), a unit quaternion with w >= 0."""
        return self._frame[ATTITUDE, :4]

    @property
    def covariance(self) -> Array:
        """Return the covariance (6, 6) of position (m, world axes), then of the attitude error as a
        rotation vector.

        The latter is in rad, world axes, in the order of geometry_msgs/PoseWithCovariance.
        """
        return self._frame[:6]

    @property
    def residual(self) -> float:
        """Return the rms angle between measured and predicted bearings, rad.

        With four beacons two degrees of freedom are left, which hardly reveal a wrong one; so check
        the pose against a prediction.
        """
        return float(self._frame[POSITION, 3])

    def __repr__(self) -> str:
        return (
            f"PlanarPose(position_w={self.position_w}, quaternion_wb={self.quaternion_wb}, "
            f"residual={self.residual:.3g})"
        )


class PlanarPoseSolver:
    """Solves frames of bearings to one set of beacons.

    Args:
        beacons_w: (N, 3) m, coplanar, not on one line, N >= 4.
        ids: (N,) of the beacons, to check that none occurs twice; optional.
        steps: most Gauss-Newton steps; 0 is the homography alone.

    Raises MeasurementError when malformed, DegenerateGeometryError when the beacons determine no
    pose (`BeaconPlane.of`).
    """

    def __init__(
        self, beacons_w: npt.ArrayLike, ids: Sequence[int] | None = None, steps: int = MAX_STEPS
    ) -> None:
        self.plane = plane = BeaconPlane.of(beacons_w, ids)
        self._template = _template(plane, steps)
        self._others = [_template(other, steps) for other in plane.others()]
        self._kernel = _ready_kernel()

    def solve(
        self, bearings_b: Array, sigma: float, prediction: tuple[Array, Array] | None = None
    ) -> PlanarPose:
        """Return the pose that explains the bearings best.

        Args:
            bearings_b: (N, 3) unit vectors in body axes, in the beacons' order.
            sigma: rad on each of two tangent axes.
            prediction: position_w (3,) and quaternion_wb (4,) of a filter. Near the beacons' own
                plane the homography fails although the information exists: the search starts from
                the prediction, and also from the homography when the result explains the bearings
                badly.

        Raises MeasurementError when the input is malformed or no pose fits, DegenerateGeometryError
        when the bearings do not determine one.
        """
        frame = self._template.copy()
        if prediction is not None:
            frame[POSITION, :3], frame[ATTITUDE, :4] = prediction
            frame[ATTITUDE, 5] = 1.0
        if type(bearings_b) is not np.ndarray or not bearings_b.flags.carray:
            bearings_b = _as_compiled_for(bearings_b)  # a list, a record's field, or read-only
        try:
            code = self._kernel(bearings_b, frame, sigma)
        except TypeError:  # single precision, one axis, or anything else it was not compiled for
            code = self._kernel(_as_compiled_for(bearings_b), frame, float(sigma))
        if code == DOUBTFUL or (code >= NO_START and self._others):
            code, frame = self._better(code, frame, bearings_b, sigma)
        if code:
            raise self._refusal(code, np.asarray(bearings_b, dtype=float), sigma, frame)
        return PlanarPose(frame)

    def _better(
        self, code: int, frame: Array, bearings_b: Array, sigma: float
    ) -> tuple[int, Array]:
        """Return the best of the given pose, if any, and those from other fours."""
        bearings = _as_compiled_for(bearings_b)
        best = frame[POSITION, 3] if code == DOUBTFUL else math.inf
        for template in self._others:
            trial = template.copy()
            found = self._kernel(bearings, trial, float(sigma))
            if found in (SOLVED, DOUBTFUL) and trial[POSITION, 3] < best:
                code, frame, best = found, trial, trial[POSITION, 3]
            if found == SOLVED:
                break
        return (SOLVED if code == DOUBTFUL else code), frame

    def _refusal(self, code: int, bearings: Array, sigma: float, frame: Array) -> MeasurementError:
        count = len(self.plane.beacons_w)
        if code == SHAPE:
            return MeasurementError(
                f"bearings of shape {bearings.shape} for {count} beacons; "
                f"both must be (N, 3), one bearing a beacon, here ({count}, 3)"
            )
        if code == NOT_FINITE:
            return MeasurementError("a bearing is not finite; check the beacon detector")
        if code == NOT_UNIT:
            lengths = np.sqrt((bearings**2).sum(axis=1))
            worst = lengths[np.argmax(np.abs(lengths - 1.0))]
            return MeasurementError(
                f"a bearing has length {worst:.4g}; unit vectors in body axes are needed "
                f"(within {UNIT:.0%})"
            )
        if code == BAD_SIGMA:
            return MeasurementError(f"sigma = {sigma} rad; a finite number above 0 is needed")
        if code == BAD_PREDICTION:
            return MeasurementError(
                "the predicted pose is not finite or its quaternion is 0; "
                "give a finite one, or omit it"
            )
        if code == NO_FIT:
            residual = frame[POSITION, 3]
            allowed = sigma * math.sqrt(chi_square(2.0 * count - 6.0) / count)
            return MeasurementError(
                f"no pose fits the bearings: {math.degrees(residual):.3g}° rms remain where "
                f"noise leaves at most {math.degrees(allowed):.3g}; check the beacons' identities "
                "and positions, or give a predicted pose to start from"
            )
        if code == NO_START and not self.plane.spanned:
            return DegenerateGeometryError(
                "bearings do not determine a pose: three of four beacons lie on one line; "
                "move one aside, or give a predicted pose to start from"
            )
        if np.linalg.svd(bearings, compute_uv=False)[2] < 1e-6:
            return DegenerateGeometryError(
                "bearings do not determine a pose: they all lie in one plane, as seen from the "
                "beacons' own; move the vehicle off it, or give a predicted pose to start from"
            )
        return DegenerateGeometryError(
            "bearings do not determine a pose: the beacons are too far away or seen edge-on; "
            "come closer, or give a predicted pose to start from"
        )


def planar_pose(
    beacons_w: Array, bearings_b: Array, sigma: float, prediction: tuple[Array, Array] | None = None
) -> PlanarPose:
    """Return `PlanarPoseSolver(beacons_w).solve(...)`, with the solver cached by the beacons'
    positions.

    Args:
        beacons_w: (N, 3) m, coplanar, not on one line, N >= 4.
        bearings_b, sigma, prediction: see `PlanarPoseSolver.solve`.

    Raises MeasurementError and DegenerateGeometryError as those do.
    """
    beacons = np.ascontiguousarray(beacons_w, dtype=float)
    if beacons.ndim != 2 or beacons.shape[1] != 3 or beacons.shape != np.shape(bearings_b):
        raise MeasurementError(
            f"beacons of shape {beacons.shape} and bearings of shape {np.shape(bearings_b)}; "
            "both must be (N, 3), one bearing a beacon"
        )
    return _solver(beacons.tobytes()).solve(bearings_b, sigma, prediction)


def _template(plane: BeaconPlane, steps: int) -> Array:
    """Return the frame, see `bearing_frame`, without its bearings."""
    frame = np.zeros((SIGHTS + len(plane.beacons_w), 6))
    frame[ATTITUDE, 4] = steps
    frame[CENTER, :3], frame[CENTER, 3:] = plane.center_w, plane.four[:3]
    frame[PLANE : PLANE + 4] = plane.homography
    frame[PLANE + 3, 4:] = plane.four[3], plane.spanned
    frame[SIGHTS:, :3] = plane.beacons_w - plane.center_w
    return frame


@lru_cache(maxsize=64)
def _solver(beacon_bytes: bytes) -> PlanarPoseSolver:
    """Return the solver, cached by the bytes of the positions (N, 3): beacons stay in place from
    frame to frame.
    """
    return PlanarPoseSolver(np.frombuffer(beacon_bytes).reshape(-1, 3))


def _as_compiled_for(bearings_b: npt.ArrayLike) -> Array:
    """Return an array of the only type for which the kernel is compiled. Raises
    MeasurementError.
    """
    try:
        bearings = np.array(bearings_b, dtype=float, order="C")
    except (TypeError, ValueError) as error:
        raise MeasurementError("bearings are not an (N, 3) array of numbers") from error
    return bearings if bearings.ndim == 2 else np.zeros((0, 0))


@lru_cache(maxsize=1)
def _ready_kernel() -> Any:
    """Return the compiled kernel, for contiguous double precision only.

    It is loaded before the first frame. Another type of array, whose compilation would halt a
    flight for a second, raises TypeError instead and is converted.
    """
    kernel: Any = solve_frame
    with _preparing:  # another thread may be compiling it, which is disabled afterwards
        if not kernel.signatures:
            kernel(np.zeros((4, 3)), np.zeros((SIGHTS + 4, 6)), 1.0)
        kernel.disable_compile()
    return kernel
