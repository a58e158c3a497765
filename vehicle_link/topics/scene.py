"""The flight for 3D panels: transforms, and markers of the vehicle and of its paths.

Foxglove, Lichtblick and RViz draw them without settings. `map` equals `world` and
`quad1/base_link` equals `quad1/body`, for tools that expect the frames of REP 105;
`quad1/reference` is where the vehicle should be. The paths are those of the last 20 s.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import cache

import numpy as np

from quadrotor.records import Array, Record
from vehicle_link.messages.cdr_layout import FixedLayout, payloads_of
from vehicle_link.topics.ticks import TO_ROS, WORLD, body_frame, set_stamps

SCENE_TOPICS = ("/tf", "/tf_static", "scene")
PERIODS_NS = (20_000_000, 1_000_000_000, 500_000_000)
POINT_NS = 200_000_000
"""Nanoseconds between two points of a path."""
POINTS = 100
ARM, ROTOR = 0.25, 0.125  # m
TIPS = ((ARM, 0.0), (0.0, ARM), (-ARM, 0.0), (0.0, -ARM))  # front, left, rear, right
ORANGE, GREEN = (1.0, 0.57, 0.17, 1.0), (0.25, 0.75, 0.47, 1.0)
DARK, PALE = (0.36, 0.4, 0.45, 1.0), (0.81, 0.84, 0.86, 0.4)
CUBE, CYLINDER, LINE_STRIP, LINE_LIST = 1, 3, 4, 5  # of visualization_msgs/Marker
HUB, ARMS, FIRST_ROTOR, FLOWN, WANTED = 0, 1, 2, 6, 7

Drawn = tuple[str, bytes, int]
"""Topic, payload, stamp in ns."""


class SceneMessages:
    """Maker of one vehicle's messages from its ticks, each when it is due by their stamps."""

    def __init__(self, vehicle: str) -> None:
        self._vehicle = vehicle
        self._due = [0] * len(SCENE_TOPICS)
        self._point_due = self._newest = self._soonest = 0
        self._flown: deque[Array] = deque(maxlen=POINTS)
        self._wanted: deque[Array] = deque(maxlen=POINTS)

    def of(self, ticks: Record) -> list[Drawn]:
        """Return the messages due at these TICK records, shape (N,), oldest first."""
        found: list[Drawn] = []
        for index, stamp in enumerate(ticks["imu"]["stamp_ns"].tolist()):
            if self._newest <= stamp < self._soonest:  # nothing is due, as in most ticks
                self._newest = stamp
                continue
            if stamp < self._newest:  # the vehicle has restarted
                self._due, self._point_due = [0] * len(SCENE_TOPICS), 0
                self._flown.clear()
                self._wanted.clear()
            self._newest = stamp
            if stamp >= self._point_due:
                self._point_due = stamp + POINT_NS
                self._flown.append(ticks[index]["state"]["position_w"].copy())
                self._wanted.append(ticks[index]["reference"]["position_w"].copy())
            for number, topic in enumerate(SCENE_TOPICS):
                if stamp >= self._due[number]:
                    self._due[number] = stamp + PERIODS_NS[number]
                    found.append((topic, self._payload(topic, ticks[index], stamp), stamp))
            self._soonest = min(self._point_due, *self._due)
        return found

    def _payload(self, topic: str, tick: np.void, stamp_ns: int) -> bytes:
        if topic == "scene":
            return self._markers(tick, stamp_ns)
        body = body_frame(self._vehicle)
        if topic == "/tf_static":
            frames = ("map", WORLD, body, f"{self._vehicle}/base_link")
        else:
            frames = (WORLD, body, WORLD, f"{self._vehicle}/reference")
        out = _transforms(*frames).new()
        set_stamps(out, stamp_ns, "transforms.0.")
        set_stamps(out, stamp_ns, "transforms.1.")
        for number in range(2):
            out[f"transforms.{number}.transform.rotation"] = (0.0, 0.0, 0.0, 1.0)
        if topic == "/tf":
            yaw = 0.5 * float(tick["reference"]["yaw"])
            out["transforms.0.transform.translation"] = tick["state"]["position_w"]
            out["transforms.0.transform.rotation"] = tick["state"]["quaternion_wb"][TO_ROS]
            out["transforms.1.transform.translation"] = tick["reference"]["position_w"]
            out["transforms.1.transform.rotation"] = (0.0, 0.0, np.sin(yaw), np.cos(yaw))
        return payloads_of(out)[0]

    def _markers(self, tick: np.void, stamp_ns: int) -> bytes:
        layout, still = _still_markers(self._vehicle)
        out = np.frombuffer(bytearray(still), layout.dtype)
        for number in range(WANTED + 1):
            set_stamps(out, stamp_ns, f"markers.{number}.")
        out[f"markers.{FLOWN}.points"] = _path(self._flown, tick["state"]["position_w"])
        out[f"markers.{WANTED}.points"] = _path(self._wanted, tick["reference"]["position_w"])
        return payloads_of(out)[0]


def _path(points: Sequence[Array], newest: Array) -> Array:
    """Return POINTS points that end with the newest, shape (POINTS, 3), the first one repeated if
    there are too few.
    """
    known = [*points, newest][-POINTS:]
    return np.array([known[0]] * (POINTS - len(known)) + known)


@cache
def _transforms(parent: str, child: str, second_parent: str, second_child: str) -> FixedLayout:
    frames = ((parent, child), (second_parent, second_child))
    strings = {f"transforms.{n}.header.frame_id": pair[0] for n, pair in enumerate(frames)}
    strings |= {f"transforms.{n}.child_frame_id": pair[1] for n, pair in enumerate(frames)}
    return FixedLayout("tf2_msgs/TFMessage", strings, {"transforms": 2})


@cache
def _still_markers(vehicle: str) -> tuple[FixedLayout, bytes]:
    """Return the layout of `scene`, and a message filled with the parts that never change."""
    body, count = body_frame(vehicle), WANTED + 1
    frames = {n: body if n < FLOWN else WORLD for n in range(count)}
    strings = {f"markers.{n}.header.frame_id": frame for n, frame in frames.items()}
    strings |= {f"markers.{n}.ns": vehicle for n in range(count)}
    lengths = {"markers": count, f"markers.{ARMS}.points": 8, f"markers.{ARMS}.colors": 8}
    lengths |= {f"markers.{n}.points": POINTS for n in (FLOWN, WANTED)}
    layout = FixedLayout("visualization_msgs/MarkerArray", strings, lengths)
    out = layout.new()
    looks = {
        HUB: (CUBE, (0.13, 0.13, 0.045), DARK),
        ARMS: (LINE_LIST, (0.018, 0.0, 0.0), DARK),
        **{FIRST_ROTOR + n: (CYLINDER, (2 * ROTOR, 2 * ROTOR, 0.004), PALE) for n in range(4)},
        FLOWN: (LINE_STRIP, (0.02, 0.0, 0.0), ORANGE),
        WANTED: (LINE_STRIP, (0.01, 0.0, 0.0), GREEN),
    }
    for number, (kind, scale, color) in looks.items():
        name = f"markers.{number}"
        out[f"{name}.id"], out[f"{name}.type"] = number, kind
        out[f"{name}.pose.orientation"] = (0.0, 0.0, 0.0, 1.0)
        out[f"{name}.scale"], out[f"{name}.color"] = scale, color
        out[f"{name}.frame_locked"] = number < FLOWN
    for number, tip in enumerate(TIPS):
        out[f"markers.{FIRST_ROTOR + number}.pose.position"] = (*tip, 0.055)
        out[f"markers.{ARMS}.points"][:, 2 * number + 1, :2] = tip
    out[f"markers.{ARMS}.colors"] = [ORANGE] * 2 + [DARK] * 6
    return layout, payloads_of(out)[0]
