"""Node of the web process against a real Zenoh router: messages, services, reconnection."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any
from unittest import mock

import pytest

from quadrotor.errors import LinkError, RefusedError, UnreachableError
from quadrotor.parameters import Parameters, ParameterStore, parameter
from tests.support.live_signals import packets_of, ticks_of
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import from_parameters, to_parameters, to_value
from vehicle_link.topics.control_inputs import decode_joy
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.session import hub_session
from web.latest import FAST, Live
from web.live.events import SUMMARY_NOW, EventHub
from web.live.sockets import listen
from web.live.station import Reactions, Station
from web.process import print_settled


class _Gains(Parameters):
    kp: float = parameter(4.0, unit="1/s²", ge=0, le=20, step=0.1, description="position gain")


class _Root(Parameters):
    gains: _Gains = _Gains()


class Backend:
    """Parameters of the vehicle behind their six services."""

    def __init__(self) -> None:
        self.store = ParameterStore(_Root().model_copy(deep=True))
        self.descriptions = self.store.descriptions
        self.values = self.store.values

    def change(self, values: Any, requester: str) -> Any:
        return self.store.set(values), self.store.revision


class Router:
    """Station's session with the services of a station and the parameters of a vehicle."""

    def __init__(self) -> None:
        with listen("127.0.0.1", 0) as free:
            self.port = free.getsockname()[1]
        self.requests: list[Any] = []
        self.backend = Backend()
        self.refusal = ""
        self.start()

    def start(self) -> None:
        self.session = hub_session(self.port)
        self.node = Node(self.session, "/quad1", "station")
        self.vehicle = Node(self.session, "/quad1", "vehicle")
        self.checked = 0.0
        for name in ("arm", "emergency", "start_behavior", "change_parameters", "record", "checks"):
            self.node.serve(f"station/{name}", SERVICES[name], self._answer(name))
        serve_parameters(self.vehicle, self.backend)
        self.ticks = self.node.advertise(TOPICS["ticks"])
        self.events = self.node.advertise(TOPICS["events"])
        self.changes = self.node.advertise(TOPICS["parameter_changes"])

    def stop(self) -> None:
        self.session.close()

    def _answer(self, name: str) -> Any:
        def answer(request: Any) -> Any:
            self.requests.append((name, request))
            fields: dict[str, Any] = {}
            if name == "change_parameters":
                applied = self.backend.store.set(from_parameters(request.parameters))
                fields = {"applied": to_parameters(applied), "revision": 7}
            if name == "checks":
                fields = {"checked": self.checked}
            return new(
                f"{SERVICES[name]}_Response",
                accepted=not self.refusal,
                reason=self.refusal,
                **fields,
            )

        return answer

    def publish_state(self) -> None:
        ticks = ticks_of(1)
        ticks["state"]["position_w"] = (1.0, 2.0, 3.0)
        self.ticks.put(packets_of(ticks)[0])


@pytest.fixture
def router() -> Iterator[Router]:
    made = Router()
    yield made
    made.stop()


class Client:
    """A Station with an event loop in a thread, like uvicorn's."""

    def __init__(self, port: int) -> None:
        self.live, self.hub = Live(decode), EventHub()
        self.loop = asyncio.new_event_loop()
        threading.Thread(target=self.loop.run_forever, daemon=True).start()
        self.hub.attach(self.loop)
        self.changes: list[Any] = []
        self.answers: list[tuple[int, bool, str]] = []
        reactions = Reactions(self.changes.append, lambda *answer: self.answers.append(answer))
        self.station = Station(
            lambda: loopback_session(port), "quad1", self.live, self.hub, reactions
        )
        self.station.watch(FAST)
        self.station.start()

    def run(self, call: Any) -> Any:
        return asyncio.run_coroutine_threadsafe(call, self.loop).result(30.0)

    def ready(self) -> bool:
        return self.station._node is not None


@pytest.fixture
def client(router: Router, until: Any) -> Iterator[Client]:
    made = Client(router.port)
    until(made.ready)
    yield made
    made.station.stop()
    made.loop.call_soon_threadsafe(made.loop.stop)


def test_messages_arrive_with_an_age(router: Router, client: Client, until: Any) -> None:
    assert client.live.age("state") == float("inf")

    def arrived() -> bool:
        router.publish_state()
        return client.live.newest("state") is not None

    until(arrived)
    state = client.live.newest("state")
    assert state is not None
    assert state.pose.pose.position.y == 2.0
    assert client.live.age("state") < 30.0


def test_commands_carry_requester_and_id_and_bring_the_reason_back(
    router: Router, client: Client
) -> None:
    client.run(client.station.command("arm", "operator 1"))
    client.run(
        client.station.command(
            "start_behavior", "operator 2", name="take_off", arguments={"height": 1.5}
        )
    )
    (_, arm), (_, take_off) = router.requests
    assert arm.requester == "operator 1"
    assert arm.request_id
    assert from_parameters(take_off.arguments) == {"height": 1.5}
    router.refusal = "the motors are off; arm the vehicle first"
    with pytest.raises(RefusedError, match=r"^the motors are off; arm the vehicle first$"):
        client.run(client.station.command("emergency", "operator 1", action="land"))


def test_parameters_are_read_and_changed(router: Router, client: Client) -> None:
    descriptions, values = client.run(client.station.read_parameters("/quad1/vehicle"))
    assert [d.name for d in descriptions] == ["gains.kp"]
    assert descriptions[0].unit == "1/s²"
    assert values == {"gains.kp": 4.0}
    changed = client.run(client.station.change_parameters({"gains.kp": 5.5}, "operator 1"))
    assert changed == ({"gains.kp": 5.5}, 7)
    assert router.requests[-1][1].requester == "operator 1"
    assert client.run(client.station.has_parameters("/quad1/vehicle"))
    assert not client.run(client.station.has_parameters("/quad1/simulator")), "it is a real one"


def test_events_and_parameter_changes_reach_the_page(
    router: Router, client: Client, until: Any
) -> None:
    changes = client.changes

    def both() -> bool:
        router.events.put(encode(new("rcl_interfaces/Log", level=30, msg="battery low", name="q")))
        change = new(
            "quadlab_msgs/ParameterChange",
            name="gains.kp",
            old_value=to_value(4.5),
            new_value=to_value(5.5),
            requester="ros2 param",
            revision=3,
            instance=9,
        )
        router.changes.put(encode(change))
        return bool(client.hub.lines) and bool(changes)

    until(both)
    line = client.hub.lines[0]
    assert (line["level"], line["text"], line["source"]) == ("warn", "battery low", "q")
    assert changes[0] == ParameterChange(0, "gains.kp", 4.5, 5.5, "ros2 param", 3, 9)


def test_forwarded_messages_come_as_they_are_and_only_while_they_are_wanted(
    router: Router, client: Client, until: Any
) -> None:
    came: list[bytes] = []
    payload = encode(new("rcl_interfaces/Log", level=20, msg="hello"))
    client.station.forward({"events": lambda received: came.append(received.payload)})

    def arrived() -> bool:
        router.events.put(payload)
        return bool(came)

    until(arrived)
    assert set(came) == {payload}
    client.station.forward({"ticks": lambda received: None})
    until(lambda: router.ticks.has_subscribers)  # this is known after the other has ended
    count = len(came)
    router.events.put(payload)
    until(lambda: any(line["text"] == "hello" for line in client.hub.lines))
    assert len(came) == count


def test_a_link_in_another_state_brings_every_page_its_summary_at_once(
    router: Router, client: Client, until: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[Any] = []
    monkeypatch.setattr(client.hub, "publish", published.append)
    link = router.node.advertise(TOPICS["link_status"])

    def told(state: str, count: int) -> bool:
        link.put(encode(new("quadlab_msgs/LinkStatus", state=state)))
        shown = client.live.newest("link_status")
        return shown is not None and shown.state == state and len(published) == count

    until(lambda: told("good", 1))
    until(lambda: told("degraded", 2))
    assert told("degraded", 2)
    assert published == [SUMMARY_NOW, SUMMARY_NOW]


def test_an_absent_station_is_one_line_and_its_return_is_noticed(
    router: Router, client: Client, until: Any
) -> None:
    client.run(client.station.command("arm", "operator 1"))
    router.stop()
    with pytest.raises(LinkError) as caught:
        client.run(client.station.command("arm", "operator 1"))
    assert "\n" not in str(caught.value)
    router.start()

    def back() -> bool:
        router.publish_state()
        return client.live.age("state") < 5.0

    until(back)
    client.run(client.station.command("arm", "operator 1"))


def test_sticks_carry_their_owner_and_the_stations_answer_finds_back(
    router: Router, client: Client, until: Any
) -> None:
    came: list[Any] = []
    answers = client.answers
    stick, status = TOPICS["stick"], TOPICS["stick_status"]
    router.node.subscribe(stick.name, stick.type_name, came.append)
    answering = router.node.advertise(status)
    stamps: list[int] = []

    def arrived() -> bool:
        stamps.append(client.station.publish_stick((0.5, 0, 0, 0), True, "operator 1"))
        return bool(came)

    until(arrived)
    sticks = decode_joy(came[-1].payload)
    assert (sticks.requester, sticks.enabled, sticks.axes[0]) == ("operator 1", True, 0.5)
    assert sticks.stamp_ns in stamps

    def answered() -> bool:
        message = new(status.type_name, header=header(sticks.stamp_ns), reason="silent")
        answering.put(encode(message))
        return bool(answers)

    until(answered)
    assert answers[0] == (sticks.stamp_ns, False, "silent")


def test_before_the_first_session_commands_say_so() -> None:
    station = Station(mock.Mock(), "quad1", Live(decode), EventHub(), Reactions())
    with pytest.raises(UnreachableError):
        asyncio.run(station.command("arm", "operator 1"))


def test_the_sign_in_link_is_printed_after_the_start_up_checks(
    router: Router, client: Client, until: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    stations = [(client.live, client.station)]
    printing = threading.Thread(target=print_settled, args=("http://here/?token=1", stations))
    printing.start()
    printed: list[str] = []

    def is_printed(text: str) -> bool:
        printed.append(capsys.readouterr().out)
        return text in "".join(printed)

    until(lambda: is_printed("quadlab: waiting for the vehicle, 0 s"))
    status = router.vehicle.advertise(TOPICS["status"])

    def is_printed_of_a_vehicle(text: str) -> bool:
        status.put(encode(new("quadlab_msgs/VehicleStatus")))
        return is_printed(text)

    until(lambda: is_printed_of_a_vehicle("quadlab: running the start-up checks"))
    assert "http" not in "".join(printed)
    router.checked = 1.0
    until(lambda: is_printed_of_a_vehicle("quadlab is at  http://here/?token=1"))
    printing.join()


def test_the_sign_in_link_does_not_wait_for_a_vehicle_that_is_compiled(
    client: Client, capsys: pytest.CaptureFixture[str]
) -> None:
    print_settled("http://here/?token=1", [(client.live, client.station)], longest=0.0)
    assert capsys.readouterr().out.splitlines() == [
        "quadlab: the vehicle still starts (compiled the first time)",
        "",
        "quadlab is at  http://here/?token=1",
    ]


def test_a_station_that_is_not_there_has_made_no_checks() -> None:
    absent = Client(9)
    assert not absent.station.has_checked()
    absent.station.stop()
    absent.loop.call_soon_threadsafe(absent.loop.stop)
