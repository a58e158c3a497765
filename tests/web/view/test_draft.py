"""A draft is moved by its owner's pointer alone, by click or handle, and tells what it would be."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any, cast

import pytest

from control.behaviors.preview import preview
from tests.support.narrowing import now
from vehicle_link.messages import decode, encode, new
from web.commands.drafts import DraftBody, Drafts
from web.commands.previewer import Previewer
from web.commands.trajectories import TrajectoryMonitor
from web.latest import Live
from web.view.draft import Draft
from web.view.drag import Click, Drag, Phase, click_of
from web.view.server import ViewServer
from web.view.shapes import Point, along_axis

EYE: Point = (-2.0, -2.0, 3.0)
ME = "operator 1"


class Desk:
    """The draft of a vehicle at the origin, with a drawn view but without a browser."""

    def __init__(self, server: ViewServer) -> None:
        self.server, self.told, self.plans = server, [], []
        live = Live(decode, lambda: 0.0)
        live.put("reference", encode(new("quadlab_msgs/Reference", position=(0.0, 0.0, 1.0))))
        live.put("status", encode(new("quadlab_msgs/VehicleStatus", airborne=True)))
        monitor = TrajectoryMonitor(live, cast(Any, self), cast(Any, self))
        self.set: dict[str, Any] = {
            f"behavior.volume_{axis}_{end}": wall
            for axis, walls in zip("xyz", ((-3.0, 3.0), (-3.0, 3.0), (0.2, 3.0)), strict=True)
            for end, wall in zip(("min", "max"), walls, strict=True)
        }
        self.drafts = Drafts(server, monitor, self.told.append, self.set.get)

    told: list[Any]
    plans: list[bool]

    def values(self) -> dict[str, Any]:
        return self.set

    def plan(self, points: Any, feasible: bool = True) -> None:
        self.plans.append(points is not None and feasible)

    def open(self, kind: Any, by: str = ME, **more: Any) -> None:
        self.drafts.open(DraftBody(kind=kind, **more), by)

    def drag(self, name: str, *places: Point, who: str = ME) -> None:
        """Drag a handle along places that the pointer covers."""
        updates: list[Phase] = ["update"] * (len(places) - 1)
        phases: list[Phase] = ["start", *updates, "end"]
        for phase, place in zip(phases, (*places, places[-1]), strict=True):
            self.server.draggable[name](Drag(name, phase, place, EYE, who))

    def click(self, ground: Point, who: str = ME) -> None:
        assert self.server.on_click is not None
        self.server.on_click(Click(EYE, ground, who))

    @property
    def points(self) -> Any:
        return (self.drafts.summary() or {})["points"]

    def judged(self) -> dict[str, Any]:
        """Return what is told once the draft has been judged."""

        async def judge() -> None:
            task = asyncio.create_task(self.drafts.run())
            while not (self.drafts.summary() or {}).get("checked"):
                await asyncio.sleep(0)
            task.cancel()

        asyncio.run(judge())
        return cast(dict[str, Any], self.told[-1]["draft"])


@pytest.fixture(scope="module")
def server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


@pytest.fixture
def desk(server: ViewServer, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setattr(Previewer, "compute", lambda _, *given: preview(*given))
    made = Desk(server)
    yield made
    made.drafts.close()


def test_a_target_starts_ahead_and_goes_where_its_owner_clicks_or_drags(desk: Desk) -> None:
    desk.open("target")
    assert desk.points == ((0.5, 0.0, 1.0),)
    desk.click((1.0, -1.5, 0.0))
    assert desk.points == ((1.0, -1.5, 1.0),)
    desk.drag("/draft/0/handle", (1.0, -1.5, 1.0), (1.2, 0.4, 1.0))
    assert desk.points == ((1.2, 0.4, 1.0),)
    desk.drag("/draft/along_0", (1.2, 0.4, 1.3), (1.2, 0.4, 1.8))
    assert desk.points == ((1.2, 0.4, 1.5),)


def test_nobody_else_moves_a_draft(desk: Desk) -> None:
    desk.open("target")
    desk.click((1.0, 1.0, 0.0), who="operator 2")
    desk.drag("/draft/0/handle", (0.5, 0.0, 1.0), (1.2, 0.4, 1.0), who="operator 2")
    assert desk.points == ((0.5, 0.0, 1.0),)
    desk.open("target", by="operator 2")
    desk.click((1.0, 1.0, 0.0), who="operator 2")
    assert desk.points == ((1.0, 1.0, 1.0),)


def test_each_click_adds_a_way_point_until_there_are_twelve(desk: Desk) -> None:
    desk.open("waypoints")
    for k in range(14):
        desk.click((-1.0, 0.2 * k - 1.0, 0.0))
    assert len(desk.points) == 12
    assert desk.points[1] == (-1.0, -1.0, 1.0)


def test_the_faces_of_a_volume_move_along_their_axis_and_never_cross(desk: Desk) -> None:
    desk.open("volume")
    desk.drag("/draft/along_1", (3.0, 0.0, 1.6), (2.0, 0.0, 1.6))
    assert desk.points[1][0] == 2.0
    assert desk.points[1][1:] == (3.0, 3.0)
    moved = Draft("volume", ((-1.0, -1.0, 0.2), (1.0, 1.0, 2.0)), ME).moved(1, (-5.0, 0.0, 0.0))
    assert moved.points == ((-1.0, -1.0, 0.2), (-0.9, 1.0, 2.0))


def test_a_volume_and_a_keep_out_box_tell_the_parameters_to_set_all_or_none(desk: Desk) -> None:
    desk.open("volume", points=[(-1.0, -2.0, 0.2), (1.0, 2.0, 2.5)])
    found = now(desk.drafts.summary() or {})
    assert list(found["values"].values()) == [-1.0, -2.0, 0.2, 1.0, 2.0, 2.5]
    assert "behavior.volume_y_max" in found["values"]
    pillar = "pillar -2.0 -1.5 0.0 0.5 0.0 2.0"
    desk.set |= {"behavior.keep_out": pillar, "behavior.keep_out_margin": 0.4}
    desk.open("keep_out", arguments={"box": "pillar"})
    desk.drag("/draft/along_1", (-1.5, 0.25, 1.0), (-1.3, 0.25, 1.0))
    found = now(desk.drafts.summary() or {})
    assert found["values"] == {"behavior.keep_out": "pillar -2.0 -1.3 0.0 0.5 0.0 2.0"}
    assert found["removal"] == {"behavior.keep_out": "none"}
    desk.open("keep_out")
    found = desk.judged()
    assert (found["arguments"], found["removal"], found["refusal"]) == ({"box": "box_1"}, None, "")
    assert found["values"]["behavior.keep_out"].startswith(f"{pillar}; box_1 1.15 1.65 ")
    desk.click((0.3, 0.3, 0.0))
    assert "the vehicle at (0.00, 0.00, 1.00) m is inside" in desk.judged()["refusal"]


def test_a_path_into_a_keep_out_box_is_red_and_names_it(desk: Desk) -> None:
    desk.set["behavior.keep_out"] = "pillar 0.8 1.0 -1.0 1.0 0.0 2.0"
    desk.open("target", points=[(2.0, 0.0, 1.0)])
    assert "the keep-out box pillar at (0.40, 0.00, 1.00) m" in desk.judged()["refusal"]
    assert now(desk.plans)[-1] is False


def test_a_draft_that_the_vehicle_could_not_fly_says_why_and_one_that_it_could_its_time(
    desk: Desk,
) -> None:
    desk.open("target", points=[(1.0, 0.0, 1.0)])
    found = desk.judged()
    assert found["refusal"] == ""
    assert 1.0 < found["duration"] < 5.0
    assert now(desk.plans)[-1]
    desk.open("target", points=[(4.0, 0.0, 1.0)])
    assert "x = 4.00 m is outside the flight volume" in desk.judged()["refusal"]
    assert now(desk.plans)[-1] is False
    desk.open("waypoints", points=[(1.0, 0.0, 1.0), (1.0, 1.0, 1.2)])
    assert desk.judged()["refusal"] == ""
    arguments = {"trajectory": "circle", "laps": 1, "period": 8.0, "radius": 0.5}
    desk.open("trajectory", points=[(2.9, 2.9, 1.0)], arguments=arguments)
    assert "outside the flight volume" in desk.judged()["refusal"]


def test_closed_drafts_show_nothing_and_take_no_pointer(desk: Desk) -> None:
    desk.open("target")
    desk.drafts.close()
    assert desk.told[-1] == {"type": "draft", "draft": None}
    assert not any(name.startswith("/draft") for name in desk.server.draggable)
    assert now(desk.server).on_click is None


def test_what_is_no_click_is_none() -> None:
    assert click_of(b"\xc1", ME) is None


def test_an_axis_is_met_where_the_line_of_sight_is_nearest() -> None:
    met = along_axis((3.0, 0.0, 1.0), (1.0, 0.0, 1.5), (0.0, 0.0, 0.5), 2)
    assert met == pytest.approx((0.0, 0.0, 1.75))
    assert along_axis((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.5), 2) is None
