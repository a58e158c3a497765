"""One estimate drawn as a ghost, with the three-sigma ellipsoid of its position."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vehicle_link.messages.records import EstimatorComparison, PoseWithCovarianceStamped
from web.view.airframe import Airframe
from web.view.shapes import Array, Point, Quaternion, ellipsoid, point_of, wxyz_of

if TYPE_CHECKING:
    from viser import SceneApi

TINT = (186, 142, 226)
OPACITY = 0.16
LARGEST = 10.0  # m; a larger half axis is meaningless and would fill the view
CHANGED = 0.04  # share by which a covariance must differ to be drawn again
ONE_FRAME = "one frame"


class Estimate(NamedTuple):
    """Position (m), quaternion and covariance (3, 3) m^2; NaN where not known."""

    position: Point
    quaternion: Quaternion
    covariance: Array

    @property
    def is_sound(self) -> bool:
        return all(map(math.isfinite, (*self.position, *self.quaternion)))


def of_one_frame(message: PoseWithCovarianceStamped) -> Estimate:
    """Return the estimate of a `bearing_pose` message (PoseWithCovarianceStamped)."""
    pose = message.pose.pose
    covariance = np.array(message.pose.covariance, float).reshape(6, 6)[:3, :3]
    return Estimate(point_of(pose.position), wxyz_of(pose.orientation), covariance)


def of_comparison(message: EstimatorComparison, name: str) -> Estimate | None:
    """Return the result of this name, or None if it is missing or not yet initialized."""
    for one in message.estimators:
        if one.name == name and one.initialized:
            covariance = np.array(one.position_covariance, float).reshape(3, 3)
            position, orientation = one.pose.position, one.pose.orientation
            return Estimate(point_of(position), wxyz_of(orientation), covariance)
    return None


class EstimateGhost:
    """Ghost of an estimate: the nodes `/estimate/body` and `/estimate/covariance`."""

    def __init__(self, api: SceneApi) -> None:
        self._frame = api.add_frame("/estimate", show_axes=False, visible=False)
        self._body = Airframe(api, "/estimate/body", ghost=True, tint=TINT, opacity=0.4)
        self._body.frame.visible = True
        self._ellipsoid = api.add_icosphere(
            "/estimate/covariance",
            radius=1.0,
            subdivisions=3,
            color=TINT,
            opacity=OPACITY,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._drawn = np.full((3, 3), np.nan)

    def show(self, estimate: Estimate | None) -> None:
        """Show an estimate; None hides it."""
        if estimate is None or not estimate.is_sound:
            self._frame.visible = False
            return
        self._frame.position = estimate.position
        self._body.pose((0.0, 0.0, 0.0), estimate.quaternion)
        self._draw(estimate.covariance)
        self._frame.visible = True

    def _draw(self, covariance: Array) -> None:
        found = ellipsoid(covariance)
        is_shown = found is not None and max(found[0]) < LARGEST
        if is_shown and not _alike(covariance, self._drawn):
            assert found is not None
            self._ellipsoid.scale, self._ellipsoid.wxyz = found
            self._drawn = covariance.copy()
        self._ellipsoid.visible = is_shown


def _alike(a: Array, b: Array) -> bool:
    """Return whether two covariances look the same; always False for NaN."""
    return bool(np.abs(a - b).max() <= CHANGED * np.abs(a).max())
