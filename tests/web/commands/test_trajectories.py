"""A trajectory is looked at before it is flown; while it is flown the summary has its progress."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from control.behaviors.preview import preview
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.messages import decode, encode, header, new
from web.commands.previewer import Previewer
from web.commands.trajectories import TrajectoryMonitor
from web.latest import Live

CIRCLE: dict[str, ParameterValue] = {"trajectory": "circle", "laps": 2, "period": 8.0}
SECOND = 10**9


class Scene:
    def __init__(self) -> None:
        self.plans: list[tuple[Any, bool]] = []

    def plan(self, points: Any, feasible: bool = True) -> None:
        self.plans.append((points, feasible))


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def live() -> Live:
    return Live(decode, lambda: 0.0)


@pytest.fixture
def monitor(monkeypatch: pytest.MonkeyPatch, live: Live, scene: Scene) -> TrajectoryMonitor:
    """Return a monitor that computes in this process."""
    monkeypatch.setattr(Previewer, "compute", lambda _, *given: preview(*given))
    replica = SimpleNamespace(values=lambda: {"behavior.volume_x_max": 2.5})
    return TrajectoryMonitor(live, cast(Any, replica), cast(Any, scene))


def fly(live: Live, behavior: str, seconds: float) -> None:
    stamp = header(100 * SECOND + round(seconds * SECOND))
    status = new("quadlab_msgs/VehicleStatus", header=stamp, behavior=behavior, airborne=True)
    live.put("status", encode(status))


def test_it_starts_at_the_reference_in_flight_and_above_the_vehicle_on_the_ground(
    monitor: TrajectoryMonitor, live: Live, scene: Scene
) -> None:
    pose = {"pose": {"position": (0.4, 0.3, 0.05), "orientation": (0.0, 0.0, 0.0, 1.0)}}
    live.put("state", encode(new("nav_msgs/Odometry", header=header(0), pose=pose)))
    found = asyncio.run(monitor.preview(CIRCLE))
    assert (found["duration"], found["refusal"]) == (19.0, "")
    live.put("reference", encode(new("quadlab_msgs/Reference", position=(1.0, 0.0, 1.5))))
    fly(live, "HOVER", 0.0)
    asyncio.run(monitor.preview(CIRCLE))
    starts = [points[0].tolist() for points, _ in scene.plans]
    assert starts == [pytest.approx([0.4, 0.3, 1.0]), pytest.approx([1.0, 0.0, 1.5])]


def test_one_that_is_refused_is_drawn_as_such_and_one_that_is_none_is_not_drawn(
    monitor: TrajectoryMonitor, scene: Scene
) -> None:
    found = asyncio.run(monitor.preview({"trajectory": "circle", "radius": 3.0, "period": 30.0}))
    assert "flight volume" in found["refusal"]
    assert scene.plans[-1][1] is False
    with pytest.raises(OutOfBoundsError):
        asyncio.run(monitor.preview({"trajectory": "circle", "radius": 99.0}))
    assert scene.plans[-1][0] is None


def test_the_summary_tells_how_far_it_is_by_the_vehicles_clock(
    monitor: TrajectoryMonitor, live: Live
) -> None:
    asyncio.run(monitor.preview(CIRCLE))
    fly(live, "HOVER", 0.0)
    monitor.started(CIRCLE)
    assert monitor.summary() is None
    fly(live, "FOLLOW_TRAJECTORY", 1.0)
    assert monitor.summary() == {"elapsed": 0.0, "duration": 19.0, "laps": 2, "name": "circle"}
    fly(live, "FOLLOW_TRAJECTORY", 5.5)
    assert monitor.summary() == {"elapsed": 4.5, "duration": 19.0, "laps": 2, "name": "circle"}
    fly(live, "HOVER", 20.0)
    assert monitor.summary() is None
    fly(live, "FOLLOW_TRAJECTORY", 30.0)  # started by another program
    assert monitor.summary() is None
