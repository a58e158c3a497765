"""An emergency is retried, done once, and not reported as done before the vehicle shows it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from quadrotor.errors import LinkError, RefusedError
from vehicle_link.messages import decode, encode, new
from web.commands.emergency import PATIENCE, TRIES, EmergencyCommands
from web.latest import Live

SILENT = LinkError("the vehicle did not answer within 1 s")


class Bench:
    """Desk with a controlled clock, a vehicle with a scripted status, and the pages."""

    def __init__(self) -> None:
        self.now = 100.0
        self.chosen: str | None = None  # safety.emergency_land, if known
        self.answers: list[Exception | None] = []
        self.calls: list[tuple[str, str, str]] = []
        self.published: list[dict[str, Any]] = []
        self.said: list[str] = []
        self.may_answer = asyncio.Event()
        self.may_answer.set()
        self.live = Live(decode, lambda: self.now)
        self.desk = EmergencyCommands(
            self,
            self.live,
            self.published.append,
            lambda _, line: self.said.append(line),
            lambda: self.now,
            lambda: self.chosen,
        )

    async def command(self, service: str, requester: str, **fields: Any) -> None:
        self.calls.append((fields["action"], requester, fields["request_id"]))
        await self.may_answer.wait()
        self.now += 1.0
        error = self.answers.pop(0) if self.answers else None
        if error is not None:
            raise error

    def show(self, mode: str, **fields: str) -> None:
        self.live.put("status", encode(new("quadlab_msgs/VehicleStatus", mode=mode, **fields)))

    @property
    def phases(self) -> list[tuple[str, int]]:
        return [(m["press"]["phase"], m["press"]["try"]) for m in self.published]

    async def called(self, count: int) -> None:
        """Wait until the station has been called so often."""
        async with asyncio.timeout(20):
            while len(self.calls) < count:
                await asyncio.sleep(0)

    async def until(self, phase: str) -> dict[str, Any]:
        """Return the state once it is in this phase; the bound is only for a broken desk."""
        async with asyncio.timeout(20):
            while self.desk.state is None or self.desk.state["phase"] != phase:
                await asyncio.sleep(0)
        return self.desk.state


def benched(test: Callable[[Bench], Awaitable[None]]) -> Callable[[], None]:
    """Run the test on a separate event loop, with a bench made there."""

    async def run() -> None:
        await test(Bench())

    def wrapped() -> None:
        asyncio.run(run())

    wrapped.__name__ = test.__name__
    return wrapped


@benched
async def test_acknowledged_only_when_a_status_after_the_press_shows_it(bench: Bench) -> None:
    bench.show("emergency_land")  # the status of an earlier landing
    bench.now += 5.0
    await bench.desk.press("land", "ada", "once")
    assert (await bench.until("accepted"))["after"] is None
    bench.show("armed")
    for _ in range(3):
        await asyncio.sleep(0.02)
    assert bench.desk.state is not None
    assert bench.desk.state["phase"] == "accepted"
    bench.now += 0.5
    bench.show("emergency_land")
    state = await bench.until("acknowledged")
    assert state["after"] == 1.5
    assert (state["action"], state["by"], state["id"]) == ("land", "ada", "once")
    assert bench.phases == [("sent", 1), ("accepted", 1), ("acknowledged", 1)]


LANDINGS = (
    {"control_mode": "direct", "behavior": "land"},
    {"control_mode": "near_hovering", "behavior": "emergency_landing"},
    {"control_mode": "emergency", "behavior": "hover"},
)
"""Choices from the mildest to the microcontroller's own."""


@pytest.mark.parametrize(("chosen", "mildest"), [("land", 0), ("descend", 1), ("emergency", 2)])
def test_a_milder_landing_than_the_chosen_one_acknowledges_nothing(
    chosen: str, mildest: int
) -> None:
    @benched
    async def pressed(bench: Bench) -> None:
        bench.chosen = chosen
        await bench.desk.press("land", "ada")
        for place, landing in enumerate(LANDINGS):
            bench.now += 0.1
            bench.show("emergency_land", **landing)
            if place >= mildest:
                break
            for _ in range(3):
                await asyncio.sleep(0.02)
            assert bench.desk.state is not None
            assert bench.desk.state["phase"] == "accepted"
        assert (await bench.until("acknowledged"))["reason"] == ""

    pressed()


@benched
async def test_a_microcontroller_that_does_not_take_over_is_named(bench: Bench) -> None:
    bench.chosen = "emergency"
    await bench.desk.press("land", "ada")
    bench.show("emergency_land", **LANDINGS[0])
    bench.now += PATIENCE + 1.0
    reason = (await bench.until("failed"))["reason"]
    assert reason == "accepted, but the microcontroller has not taken over within 10 s"


@benched
async def test_a_lost_answer_is_asked_for_again_under_the_same_id(bench: Bench) -> None:
    bench.answers = [SILENT, SILENT]
    await bench.desk.press("cut", "ada")
    assert len(set(bench.calls)) == 1
    assert len(bench.calls) == TRIES == 3
    assert bench.phases == [("sent", 1), ("sent", 2), ("sent", 3), ("accepted", 3)]


@benched
async def test_a_cut_under_the_id_of_a_landing_is_no_repetition_of_it(bench: Bench) -> None:
    for action in ("land", "cut"):
        assert await bench.desk.press(action, "a program", "stop") == "stop"
    assert len({request_id for *_, request_id in bench.calls}) == 2


@benched
async def test_a_refusal_is_not_tried_again_and_says_why(bench: Bench) -> None:
    bench.answers = [RefusedError("emergency land refused: the motors are off")]
    with pytest.raises(RefusedError, match="the motors are off"):
        await bench.desk.press("land", "ada")
    assert len(bench.calls) == 1
    state = await bench.until("failed")
    assert state["reason"] == "emergency land refused: the motors are off"
    assert bench.said == [
        "emergency land by ada failed: emergency land refused: the motors are off"
    ]


@benched
async def test_never_answered_is_failed(bench: Bench) -> None:
    bench.show("armed")
    bench.answers = [SILENT] * 3
    with pytest.raises(LinkError):
        await bench.desk.press("land", "ada")
    assert (await bench.until("failed"))["reason"] == str(SILENT)


@benched
async def test_a_defect_leaves_no_press_waiting(bench: Bench) -> None:
    bench.answers = [ValueError("a defect")]
    with pytest.raises(LinkError, match="a defect"):
        await bench.desk.press("cut", "ada")
    assert "a defect" in (await bench.until("failed"))["reason"]
    await bench.desk.press("cut", "ada")
    assert len(bench.calls) == 2


@benched
async def test_a_status_that_shows_it_is_an_answer_too(bench: Bench) -> None:
    bench.answers = [SILENT] * 3
    bench.may_answer.clear()
    pressing = asyncio.create_task(bench.desk.press("cut", "ada"))
    await bench.until("sent")
    bench.now += 0.1
    bench.show("cut")
    bench.may_answer.set()
    with pytest.raises(LinkError):
        await pressing
    assert (await bench.until("acknowledged"))["reason"] == "its answer was lost"


@benched
async def test_accepted_but_never_shown_is_failed(bench: Bench) -> None:
    await bench.desk.press("land", "ada")
    await bench.until("accepted")
    bench.now += PATIENCE + 1.0
    assert "not shown by the vehicle" in (await bench.until("failed"))["reason"]


@benched
async def test_presses_of_one_kind_share_a_call_and_its_answer(bench: Bench) -> None:
    bench.may_answer.clear()
    presses = [asyncio.create_task(bench.desk.press("land", f"viewer {i}")) for i in range(50)]
    presses.append(asyncio.create_task(bench.desk.press("cut", "ada")))
    await bench.called(2)
    assert [(action, who) for action, who, _ in bench.calls] == [
        ("land", "viewer 0"),
        ("cut", "ada"),
    ]
    bench.may_answer.set()
    await asyncio.gather(*presses)
    assert len(bench.calls) == 2


@benched
async def test_a_cut_that_waits_stays_in_sight_whoever_presses_land(bench: Bench) -> None:
    bench.may_answer.clear()
    cutting = asyncio.create_task(bench.desk.press("cut", "ada"))
    await bench.until("sent")
    landing = asyncio.create_task(bench.desk.press("land", "vera"))
    await asyncio.sleep(0)
    assert bench.desk.state is not None
    assert bench.desk.state["action"] == "cut"
    bench.may_answer.set()
    await asyncio.gather(cutting, landing)
    assert {m["press"]["action"] for m in bench.published} == {"cut"}


@benched
async def test_a_cut_does_not_wait_behind_the_tries_of_a_landing(bench: Bench) -> None:
    bench.answers = [SILENT]
    bench.may_answer.clear()
    landing = asyncio.create_task(bench.desk.press("land", "ada"))
    await bench.called(1)
    cutting = asyncio.create_task(bench.desk.press("cut", "ada"))
    await bench.called(2)
    bench.may_answer.set()
    with pytest.raises(LinkError, match="a cut followed it"):
        await landing
    await cutting
    assert [action for action, *_ in bench.calls] == ["land", "cut"]


def test_everyone_signed_in_may_land_and_only_operators_cut(
    viewer: httpx.Client, operator: httpx.Client, station: Any
) -> None:
    assert viewer.post("/api/commands/emergency", json={"action": "land"}).status_code == 200
    refused = viewer.post("/api/commands/emergency", json={"action": "cut"})
    assert refused.status_code == 403
    assert operator.post("/api/commands/emergency", json={"action": "cut"}).status_code == 200
    assert [request.action for _, request in station.requests] == ["land", "cut"]


def test_a_page_that_comes_later_hears_of_the_last_press(
    site: Any, operator: httpx.Client, station: Any, until: Any
) -> None:
    operator.post("/api/commands/emergency", json={"action": "cut", "request_id": "known"})
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        hello = json.loads(page.recv(20))
        assert hello["emergency"]["id"] == "known"
        station.put("status", new("quadlab_msgs/VehicleStatus", mode="cut"))
        while (message := json.loads(page.recv(20)))["type"] != "emergency":
            pass
    assert message["press"]["phase"] == "acknowledged"
    assert operator.get("/api/summary").json()["emergency"]["phase"] == "acknowledged"
