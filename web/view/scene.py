"""3D scene: vehicle, ghost of the truth, trails, error vector, volume, boxes, ground; cameras.

Nodes are created once and then only moved, shown or hidden. At 30 Hz this is below 60 kB/s a client
while flying, 12 kB/s on the ground while bearings arrive, and almost nothing otherwise. Unchanged
values are not sent. Beacons are drawn by `web.view.beacons.scene`.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from control.behaviors.parameters import Box, flight_volume, keep_out
from quadrotor.constants import GRAVITY
from quadrotor.plain_rotations import Array
from vehicle_link.messages.records import Odometry, Reference
from web.latest import Live
from web.view.airframe import Airframe
from web.view.beacons.scene import BeaconScene
from web.view.boxes import BoxesView
from web.view.cameras import Cameras
from web.view.ground import add_ground
from web.view.lines import PLANNED, REFUSED, edges, line_color
from web.view.options import ViewOptions, ramp
from web.view.server import ViewServer
from web.view.shapes import Point, point_of, wxyz_of
from web.view.trails import Color, Trail

if TYPE_CHECKING:
    from viser import LineSegmentsHandle, SceneApi, SceneNodeHandle

RATE, UNWATCHED = 30.0, 5.0  # Hz
GREEN, ORANGE = (64, 192, 120), (255, 146, 43)
PLAN_SHOWN = 60.0  # s, without being flown
AXES = ((229, 115, 107), (100, 186, 132), (106, 156, 232))  # x, y, z: as on the page
EDGES, DROP = (104, 120, 136), (120, 134, 148)


class Scene:
    """Scene of one vehicle; `beacons` draws the beacons and the sight of them."""

    def __init__(self, server: ViewServer, live: Live) -> None:
        self._server = server
        self._live = live
        self.cameras = Cameras(server)
        self.options = ViewOptions()
        self.mass = 0.0  # kg, of the vehicle's model; 0 while it is not known
        self._turning = False
        api = server.viser.scene
        api.set_up_direction("+z")
        self._ground = _add_room(api)
        self._volume: LineSegmentsHandle | None = None
        self._volume_box: Box | None = None
        self.boxes = BoxesView(api)
        self._vehicle = Airframe(api, "/vehicle")
        self._ghost = Airframe(api, "/truth", ghost=True)
        self._flown = Trail(api, "/flown", ORANGE, 2.5)
        self._wanted = Trail(api, "/wanted", GREEN, 1.2)
        self._plan = api.add_line_segments(
            "/plan",
            np.zeros((1, 2, 3), np.float32),
            line_color(PLANNED),
            thickness=2.0,
            thickness_units="screen",
            visible=False,
        )
        self._plan_until = 0.0  # s, monotonic
        self._target = api.add_icosphere(
            "/target", radius=0.025, subdivisions=2, color=GREEN, visible=False, cast_shadow=False
        )
        self._drop = api.add_line_segments(
            "/drop",
            np.array([[[0, 0, 0], [0, 0, 1]]], np.float32),
            line_color(DROP),
            thickness=1.0,
            thickness_units="screen",
            visible=False,
        )
        self._error = api.add_line_segments(
            "/error",
            np.zeros((1, 2, 3), np.float32),
            line_color(REFUSED),
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )
        self.beacons = BeaconScene(server, live)
        server.viser.initial_camera.position = (-1.9, -2.3, 1.9)
        server.viser.initial_camera.look_at = (0.0, 0.0, 0.8)

    def show(self, options: ViewOptions) -> None:
        """Change the drawn objects; a path with other colours starts anew."""
        if options.color != self.options.color:
            self._flown.clear()
        self.options = options
        self.cameras.shows_ground = options.ground
        for node in self._ground:
            node.visible = options.ground
        if self._volume is not None:
            self._volume.visible = options.volume
        self.boxes.show(options.volume)
        self._flown.show(options.flown)
        self._wanted.show(options.reference)

    def plan(self, points: Array | None, feasible: bool = True) -> None:
        """Show a path that may be flown next, m, world, shape (N, 3), until it has been flown or
        for PLAN_SHOWN; None takes it away.
        """
        if points is not None:
            self._plan.points = np.stack((points[:-1], points[1:]), axis=1)
            self._plan.colors = np.asarray(line_color(PLANNED if feasible else REFUSED), np.uint8)
            self._plan_until = time.monotonic() + PLAN_SHOWN
        self._plan.visible = points is not None

    @property
    def is_plan_shown(self) -> bool:
        """Return whether a path that may be flown next is shown."""
        return bool(self._plan.visible)

    def show_parameters(self, value: Callable[[str], object]) -> None:
        """Show the flight volume and the keep-out boxes of these parameters."""
        if (box := flight_volume(value)) is not None:
            self.set_volume(box)
        self.boxes.set_boxes(keep_out(value))

    def set_volume(self, box: Box) -> None:
        """Set the flight volume, ((x low, high), (y low, high), (z low, high)) in m."""
        if box == self._volume_box:
            return
        self._volume_box = box
        self.beacons.set_volume(box)
        self._volume = self._server.viser.scene.add_line_segments(
            "/volume", edges(box), line_color(EDGES), thickness=1.0, thickness_units="screen"
        )
        self._volume.visible = self.options.volume

    async def run(self) -> None:
        loop = asyncio.get_running_loop()
        deadline = loop.time()
        while True:
            rate = RATE if self._server.watched else UNWATCHED
            deadline = max(deadline + 1.0 / rate, loop.time())
            await asyncio.sleep(deadline - loop.time())
            with self._server.viser.atomic():  # one wake-up and one frame for all that moves
                self.update(time.monotonic())

    def update(self, now: float) -> None:
        """Draw one frame from the newest messages; `now` in s, monotonic."""
        state, reference = self._live.current("state"), self._live.current("reference")
        if state is not None:
            self._show_vehicle(state, now)
        if reference is not None:
            point = point_of(reference.position)
            self._wanted.add(point, now)
            self._target.position = point
        shown = self.options
        self._target.visible = reference is not None and self._airborne and shown.reference
        self._error.visible = False
        if shown.error and self._airborne and state is not None and reference is not None:
            self._error.visible = True
            self._show_error(state, reference)
        truth = self._live.current("truth")
        if truth is not None:
            self._ghost.pose(
                point_of(truth.pose.pose.position), wxyz_of(truth.pose.pose.orientation)
            )
        self._ghost.frame.visible = truth is not None and shown.truth
        if self._plan.visible:
            status = self._live.current("status")
            if status is not None and status.behavior.lower() == "follow_trajectory":
                self._plan_until = now + 2.0
            self._plan.visible = now < self._plan_until
        self._spin()
        self.beacons.update(now)
        self.cameras.tell_new()

    @property
    def _airborne(self) -> bool:
        status = self._live.current("status")
        return status is not None and bool(status.airborne)

    def _show_vehicle(self, state: Odometry, now: float) -> None:
        point = point_of(state.pose.pose.position)
        turn = wxyz_of(state.pose.pose.orientation)
        self._vehicle.pose(point, turn)
        self._vehicle.frame.visible = True
        self._flown.add(point, now, self._color(state, point))
        self._drop.points = np.array([[(point[0], point[1], 0.0), point]], np.float32)
        self._drop.visible = point[2] > 0.05
        self.cameras.move(point, turn)

    def _show_error(self, state: Odometry, reference: Reference) -> None:
        start = np.array(point_of(state.pose.pose.position))
        error = np.array(point_of(reference.position)) - start
        self._error.points = np.array([[start, start + self.options.magnified * error]], np.float32)

    def _color(self, state: Odometry, point: Point) -> Color:
        """Return the colour of the path here: that of the chosen signal, grey while unknown."""
        if self.options.color == "none":
            return ORANGE
        if self.options.color == "speed":
            velocity = point_of(state.twist.twist.linear)
            return ramp("speed", math.hypot(*velocity))
        if self.options.color == "error":
            reference = self._live.current("reference")
            if reference is None:
                return DROP
            return ramp("error", math.dist(point, point_of(reference.position)))
        actuators = self._live.current("actuators")
        if actuators is None or self.mass <= 0.0:
            return DROP
        return ramp("thrust", actuators.thrust / (self.mass * GRAVITY))

    def _spin(self) -> None:
        status, actuators = self._live.current("status"), self._live.current("actuators")
        if status is None or actuators is None or not status.armed:
            return
        # Real propellers turn 80 times a second, which no frame rate can show. Turn them by a
        # share, in every second frame, because each message is sent to every page.
        self._turning = not self._turning
        if self._turning:
            self._vehicle.spin([0.1 + float(r) * 0.0011 for r in actuators.motor_references])


def _add_room(api: SceneApi) -> list[SceneNodeHandle]:
    origin = np.zeros((3, 2, 3), np.float32)
    origin[:, 1] = 0.5 * np.eye(3)
    rgb = np.array([line_color(c) for c in AXES], np.uint8)
    axes = api.add_line_segments(
        "/origin",
        origin,
        np.repeat(rgb[:, None, :], 2, axis=1),
        thickness=2.0,
        thickness_units="screen",
        position=(0.0, 0.0, 0.002),
    )
    return [add_ground(api), axes]
