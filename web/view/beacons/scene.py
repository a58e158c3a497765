"""Beacons in the 3D view: positions, sight, an estimate, the observability map, and drags.

Everything is shared by all pages and is changed from the event loop's thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from bearing_sim.beacons import PAPER_BEACONS, Beacons
from bearing_sim.observability import FieldOfView
from control.behaviors.parameters import Box
from quadrotor.errors import OutOfBoundsError
from vehicle_link.messages import stamp_of
from vehicle_link.messages.records import BearingArray
from web.latest import STALE, Live
from web.view.beacons.estimate import (
    ONE_FRAME,
    Estimate,
    EstimateGhost,
    of_comparison,
    of_one_frame,
)
from web.view.beacons.map import BoundSlice, MapRequest
from web.view.beacons.marks import BeaconMarks
from web.view.beacons.sight_lines import RATE, PoseHistory, SightLines
from web.view.drag import BeaconDrags, Drag
from web.view.server import ViewServer

HIGHEST = 20.0  # m
FRAMES = 2.5  # number of missing frames after which what they show is stale
MANY = 10  # beacons; with more, rays and cones are sent less often
UNLIT = 0.6  # s without a bearing after which a beacon turns grey


@dataclass(frozen=True)
class BeaconView:
    """Options of the view. Raises OutOfBoundsError.

    Attributes:
        map_height: height of the map's slice, m.
        estimate: the estimate drawn as a ghost: `none`, `one frame` (topic `bearing_pose`), or a
            result of the topic `comparison` by name.
        drag: whether the handles that drag beacons are shown.
    """

    rays: bool = True
    cones: bool = True
    map: bool = False
    map_height: float = 1.0
    estimate: str = ONE_FRAME
    drag: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.map_height <= HIGHEST:
            raise OutOfBoundsError(
                f"map at {self.map_height} m; allowed is a height of 0 to {HIGHEST:g} m"
            )


MOTION: tuple[Literal["truth"], Literal["state"]] = ("truth", "state")
"""Topics with the pose of the vehicle, the better one first."""


class BeaconScene:
    """Nodes `/beacons`, `/rays`, `/cones`, `/estimate` and `/bound`.

    A dragged beacon does not move until `set_beacons` is called. `on_legend()` is called when the
    map's scale has changed.
    """

    def __init__(self, server: ViewServer, live: Live) -> None:
        self._server = server
        self._live = live
        self.on_legend: Callable[[], None] = lambda: None
        self.view = BeaconView()
        api = server.viser.scene
        self._marks = BeaconMarks(api)
        self._sight = SightLines(api)
        self._ghost = EstimateGhost(api)
        self._map = BoundSlice(api)
        self._drags = BeaconDrags()
        self._history = PoseHistory()
        self._sigma, self._rate = math.radians(1.5), 30.0
        self._sensor = FieldOfView()
        self._volume: Box | None = None
        self._lit: dict[int, float] = {}
        self._now = self._due = -math.inf
        self._drawn: BearingArray | None = None  # the newest frame of bearings, once it is drawn
        self.set_beacons(PAPER_BEACONS, self._sigma)

    def on_moved(self, react: Callable[[int, tuple[float, float, float], str], None]) -> None:
        """Call `react(id, position, who)` when an operator drags a beacon.

        It is called at most 10 times a second, and always with the last position.
        """
        self._drags.on_moved = react

    def set_beacons(
        self,
        beacons: Beacons,
        sigma_rad: float,
        sensor: FieldOfView | None = None,
        rate: float = 30.0,
    ) -> None:
        """Set the confirmed layout and the sensor's parameters used by the view.

        Args:
            sigma_rad: on each of two tangent axes.
            sensor: what it sees; everything if None.
            rate: frames a second.
        """
        self._sigma, self._rate, self._sensor = sigma_rad, rate, sensor or FieldOfView()
        if beacons != self._marks.beacons:
            self._marks.show(beacons)
            self._publish_handles()
        self._drawn = None

    def set_volume(self, box: Box) -> None:
        """Set the flight volume, over which the map is drawn."""
        self._volume = box

    def show(self, options: BeaconView) -> None:
        self.view = options
        self._marks.show_handles(options.drag)
        if not options.drag:
            self._drags.stop()
        self._publish_handles()
        self._due, self._drawn = -math.inf, None

    def put_back(self) -> None:
        """Show the confirmed layout after a move was refused."""
        self._drags.forget()

    def legend(self) -> dict[str, object] | None:
        """Return the legend of the map, or None while no map is shown.

        It has `low` and `high` in m on a logarithmic scale, `colors` from low to high, and `beyond`
        for what is above.
        """
        return self._map.legend()

    def update(self, now: float) -> None:
        """Draw one frame from the newest messages; `now` in s, monotonic."""
        self._now = now
        self._remember()
        self._drags.pass_on(now)
        self._marks.want(self._drags.wanted(self._marks.places, now))
        if self._map.update(self._map_request(), now):
            self.on_legend()
        if now >= self._due or self._due > now + 1.0:
            # A little less than a period, as frames are not exact; longer for many beacons (more
            # bytes).
            self._due = now + 0.95 / RATE * max(1.0, len(self._marks.places) / MANY)
            self._show_sight(now)
            self._ghost.show(self._estimate())

    def _remember(self) -> None:
        for source in MOTION:
            message = self._live.current(source)
            if message is not None:
                self._history.add(source, message)
                return
        self._history.clear()

    def _fresh(self, topic: str) -> Any | None:
        """Return the newest message of a topic if it is fresh, else None.

        The limit follows the sensor's rate: one of 1 Hz is not stale after half a second.
        """
        limit = max(STALE[topic], FRAMES / self._rate)
        return self._live.newest(topic) if self._live.age(topic) <= limit else None

    def _show_sight(self, now: float) -> None:
        frame = self._fresh("bearings")
        for id in map(int, frame.beacon_ids) if frame is not None else ():
            self._lit[id] = now
        limit = max(UNLIT, FRAMES / self._rate)
        lit = frozenset(id for id, at in self._lit.items() if 0.0 <= now - at <= limit)
        self._marks.light(lit if frame is not None else frozenset())
        pose = self._history.at(stamp_of(frame)) if frame is not None else None
        if frame is None or pose is None:
            self._sight.hide()
            self._drawn = None
            return
        if frame is self._drawn:
            return
        self._drawn = frame
        view = self.view
        self._sight.show(frame, pose, self._marks.places, rays=view.rays, cones=view.cones)

    def _estimate(self) -> Estimate | None:
        name = self.view.estimate
        if name == ONE_FRAME:
            message = self._fresh("bearing_pose")
            return None if message is None else of_one_frame(message)
        message = self._live.current("comparison")
        return None if message is None else of_comparison(message, name)

    def _map_request(self) -> MapRequest | None:
        beacons = self._marks.beacons
        if not self.view.map or self._volume is None or beacons is None:
            return None
        return MapRequest(beacons, self._sigma, self._sensor, self._volume, self.view.map_height)

    def _publish_handles(self) -> None:
        self._server.offer(self._marks.handles, self._dragged)

    def _dragged(self, drag: Drag) -> None:
        id = self._marks.handles.get(drag.name)
        beacons = self._marks.beacons
        if id is None or beacons is None:
            return
        x, y, z = beacons.normal_w.tolist()
        self._drags.take(drag, id, self._marks.places[id], (x, y, z), self._now)
