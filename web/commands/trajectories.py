"""Trajectories before and while they are flown: `POST /api/trajectories/preview` draws one in the
3D view and returns its demands on the vehicle; the summary has the progress of the one in flight.
"""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
from fastapi import FastAPI
from pydantic import Field

from control.behaviors.demands import Preview
from quadrotor.errors import JobTimeoutError, RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.plain_rotations import roll_pitch_yaw
from vehicle_link.messages import stamp_of
from web.access.requester import Operator
from web.body import Body
from web.commands.previewer import Previewer
from web.latest import Live
from web.parameters.replica import PageParameters
from web.view.scene import Scene
from web.view.shapes import point_of, wxyz_of

FOLLOW = "follow_trajectory"
HOVER = 1.0  # m, start height of a preview while the vehicle is on the ground
Arguments = dict[str, ParameterValue]
Start = tuple[float, float, float, float]


class PreviewBody(Body):
    arguments: Arguments = Field(description="of follow_trajectory, as start_behavior takes them")


class TrajectoryMonitor:
    """The newest preview and the trajectory in flight. Use it from the event loop only."""

    def __init__(self, live: Live, replica: PageParameters, scene: Scene) -> None:
        self._live, self._replica, self._scene = live, replica, scene
        self._previewer = Previewer()
        self._lock = asyncio.Lock()
        self._seen: tuple[Arguments, Preview] | None = None
        self._started: tuple[Arguments, float | None] | None = None  # and the duration, s
        self._began_ns: int | None = None

    def stop(self) -> None:
        self._previewer.stop()

    async def preview(self, arguments: Arguments, start: Start | None = None) -> dict[str, Any]:
        """Draw a trajectory that would start here, and return its demands on the vehicle.

        Args:
            start: x, y, z (m) and yaw (rad) of another start.

        Raises ParameterError, RefusedError, JobError.
        """
        battery = self._live.current("battery")
        voltage = None if battery is None else float(battery.voltage)
        given = (start or self.here, arguments, self._replica.values(), voltage)
        try:
            async with self._lock:
                found = await self._previewer.preview(*given)
        except JobTimeoutError:
            self._scene.plan(None)
            raise RefusedError(
                "this computer is too busy for a preview; the vehicle checks the trajectory itself "
                "when it starts"
            ) from None
        except Exception:
            self._scene.plan(None)
            raise
        self._seen = (arguments, found)
        self._scene.plan(np.asarray(found.points, np.float32), not found.refusal)
        return {"duration": found.duration, "speed": found.speed, "refusal": found.refusal}

    def started(self, arguments: Arguments) -> None:
        """Note that the vehicle has accepted this trajectory."""
        seen = self._seen
        self._started = (arguments, seen[1].duration if seen and seen[0] == arguments else None)
        self._began_ns = None

    def summary(self) -> dict[str, object] | None:
        """Return the progress of the trajectory in flight, None without one that was started here.

        Its duration is None where its path was not computed for a preview.
        """
        status = self._live.current("status")
        if status is None or self._started is None:
            return None
        if status.behavior.lower() != FOLLOW:
            if self._began_ns is not None:
                self._started = self._began_ns = None
            return None
        stamp_ns = stamp_of(status)
        self._began_ns = self._began_ns or stamp_ns
        arguments, duration = self._started
        elapsed = 1e-9 * (stamp_ns - self._began_ns)
        if duration is not None:
            elapsed, duration = min(duration, elapsed), round(duration, 1)
        laps = arguments.get("laps")
        figures = {"elapsed": round(elapsed, 1), "duration": duration, "laps": laps}
        return {**figures, "name": arguments.get("trajectory")}

    def forget(self) -> None:
        """Take the preview away."""
        self._scene.plan(None)

    @property
    def is_airborne(self) -> bool:
        status = self._live.current("status")
        return status is not None and bool(status.airborne)

    @property
    def here(self) -> Start:
        """Return x, y, z (m) and yaw (rad) of the start of a preview."""
        reference = self._live.current("reference")
        if reference is not None and self.is_airborne:
            return (*point_of(reference.position), float(reference.yaw))
        state = self._live.current("state")
        if state is None:
            return (0.0, 0.0, HOVER, 0.0)
        x, y, _ = point_of(state.pose.pose.position)
        _, _, yaw = roll_pitch_yaw(*wxyz_of(state.pose.pose.orientation))
        return (x, y, HOVER, yaw)


def add_trajectories(app: FastAPI, monitor: TrajectoryMonitor) -> None:
    @app.post("/api/trajectories/preview")
    async def show_preview(body: PreviewBody, _: Operator) -> dict[str, object]:
        """Draw a trajectory of follow_trajectory in the 3D view, and return its duration (s),
        its largest speed (m/s), and why the vehicle would refuse it, "" where it can fly it.
        """
        return await monitor.preview(body.arguments)
