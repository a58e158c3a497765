"""Bearings as cones for 3D panels: `bearing_cones`, drawn here while a client asks for them.

A cone starts at the vehicle and is as wide as three standard deviations of the sensor: amber to
beacons, blue to other vehicles of a formation.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import numpy.typing as npt

from quadrotor.errors import QuadlabError
from vehicle_link.messages.cdr_layout import FixedLayout, payloads_of
from vehicle_link.topics.measurements import decode_bearings
from vehicle_link.topics.ticks import body_frame, set_stamps

TOPIC, TYPE = "bearing_cones", "visualization_msgs/MarkerArray"
COLORS = {"bearings": (1.0, 0.75, 0.2, 0.35), "neighbour_bearings": (0.25, 0.55, 1.0, 0.35)}
"""Colour of the cones, RGBA, by the topic that they are drawn from."""
LENGTH = 1.5  # m
DEVIATIONS = 3.0
WIDEST = math.radians(60.0)  # half angle of a cone of a sensor that hardly knows
SIDES = 12
LIFETIME_NS = 300_000_000
"""Nanoseconds for which cones are drawn without newer ones: nine frames of 30 Hz."""
TRIANGLE_LIST = 11  # of visualization_msgs/Marker


def cones(topic: str, payload: bytes, vehicle: str) -> bytes | None:
    """Return the message that draws bearings of one of the topics `COLORS`; None when there is
    nothing to draw: no bearing, or numbers that are none.
    """
    try:
        seen = decode_bearings(payload)[0]
    except QuadlabError:  # the channel of the topic itself shows what came
        return None
    count = int(seen["count"])
    if count == 0:
        return None
    out = _layout(count, vehicle).new()
    set_stamps(out, int(seen["stamp_ns"]), "markers.0.")
    out["markers.0.id"], out["markers.0.type"] = list(COLORS).index(topic), TRIANGLE_LIST
    out["markers.0.pose.orientation"] = (0.0, 0.0, 0.0, 1.0)
    out["markers.0.scale"] = 1.0
    out["markers.0.color"] = COLORS[topic]
    out["markers.0.frame_locked"] = True
    out["markers.0.lifetime.nanosec"] = LIFETIME_NS
    corners = triangles(seen["bearing_b"][:count], float(seen["sigma"]))
    out["markers.0.points"] = corners.reshape(-1, 3)
    return payloads_of(out)[0]


def triangles(bearings_b: npt.NDArray[np.float64], sigma: float) -> npt.NDArray[np.float64]:
    """Return the triangles of the cones, shape (N, SIDES, 3, 3), in m and body axes.

    Args:
        bearings_b: unit vectors (N, 3), body axes.
        sigma: standard deviation of a bearing, in rad.
    """
    angle = min(DEVIATIONS * sigma, WIDEST)
    least = np.eye(3)[np.argmin(np.abs(bearings_b), axis=1)]  # an axis that is not along it
    across = np.cross(bearings_b, least)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(bearings_b, across)
    turn = np.linspace(0.0, 2.0 * math.pi, SIDES + 1)[None, :, None]
    around = np.cos(turn) * across[:, None] + np.sin(turn) * up[:, None]
    rim = LENGTH * (math.cos(angle) * bearings_b[:, None] + math.sin(angle) * around)
    return np.stack([np.zeros_like(rim[:, 1:]), rim[:, :-1], rim[:, 1:]], axis=2)


@cache
def _layout(count: int, vehicle: str) -> FixedLayout:
    strings = {"markers.0.header.frame_id": body_frame(vehicle), "markers.0.ns": TOPIC}
    return FixedLayout(TYPE, strings, {"markers": 1, "markers.0.points": 3 * SIDES * count})
