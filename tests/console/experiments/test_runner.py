"""Experiments at a real station, over real sessions, with a scripted vehicle."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.experiment_running import stick_takeover
from console.experiments.catalogue import experiments
from console.experiments.client import Client, Result
from quadlab.station_client import station
from quadrotor.errors import RefusedError
from quadrotor.extension import Experiment, Extension
from quadrotor.extensions import Offered
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import TICK
from tests.support.station import LinkedStation
from tests.waiting import LIMIT, until
from vehicle_link.commands import EventKind
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import (
    encode_change,
    from_descriptor,
    from_parameters,
    to_parameters,
)
from vehicle_link.telemetry import pack
from vehicle_link.topics.control_inputs import decode_joy, encode_heartbeat, encode_joy
from vehicle_link.topics.status import DELAYED_PREFIX, encode_event
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.parameter_service import serve_parameters
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.time_sync import serve_time_sync

ENDED = ("passed", "failed", "stopped", "refused")


class ScriptedVehicle:
    """Scripted vehicle that answers and reports, with flights of a few ticks; not the stack."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.requests: list[tuple[str, str, str]] = []  # service, behavior or action, requester
        self.refusal = ""
        self.beats = True
        self.mode, self.behavior, self.soon = "ready", "ground", ("", 0)
        self.airborne = False
        self.instance = 1
        self.values_: dict[str, ParameterValue] = {
            "estimation.source": "poses",
            "position.kp_xy": 4.0,
        }
        self.revision = 1
        self.joys: list[Any] = []
        self._out = {name: node.advertise(t) for name, t in TOPICS.items() if t.sender == "vehicle"}
        for name in ("arm", "disarm", "start_behavior", "emergency", "change_parameters"):
            node.serve(name, SERVICES[name], partial(self._do, name))
        serve_parameters(node, self)
        serve_time_sync(node, time.time_ns)
        node.subscribe("joy", TOPICS["joy"].type_name, self._on_joy)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def descriptions(self) -> tuple[ParameterDescription, ...]:
        return tuple(
            ParameterDescription(
                n,
                type(v).__name__,
                v,
                "",
                "",
                0.0 if n[0] == "p" else None,
                20.0 if n[0] == "p" else None,
                None,
                False,
                (),
            )
            for n, v in self.values_.items()
        )

    def values(self) -> dict[str, Any]:
        return dict(self.values_)

    def change(self, values: Any, requester: str) -> Any:
        raise NotImplementedError

    def close(self) -> None:
        self._closing.set()
        self._thread.join(5)

    def reset(self) -> None:
        self.mode, self.behavior, self.airborne, self.soon = "ready", "ground", False, ("", 0)
        self.refusal, self.beats = "", True
        self.status()

    def status(self) -> None:
        status = new(
            "quadlab_msgs/VehicleStatus",
            header=header(time.time_ns()),
            mode=self.mode,
            behavior=self.behavior,
            armed=self.mode == "armed",
            airborne=self.airborne,
            instance=self.instance,
            parameter_revision=self.revision,
        )
        self._out["status"].put(encode(status))

    def say(self, text: str, *kinds: EventKind) -> None:
        self._out["events"].put(encode_event(0, 30, text, "vehicle", kinds))

    def falls_back(self) -> None:
        """Let the vehicle change a parameter by itself."""
        self._apply({"estimation.source": "poses"}, "vehicle")

    def _apply(self, values: dict[str, Any], requester: str) -> None:
        self.revision += 1
        for name, value in values.items():
            now_ns, old = time.time_ns(), self.values_[name]
            change = ParameterChange(now_ns, name, old, value, requester, self.revision)
            self.values_[name] = value
            self._out["parameter_changes"].put(encode_change(change))

    def _on_joy(self, received: Received) -> None:
        self.joys.append(decode_joy(received.payload))

    def _do(self, name: str, request: Any) -> Any:
        what = str(getattr(request, "name", getattr(request, "action", "")))
        self.requests.append((name, what, request.requester))
        answer: dict[str, Any] = {"accepted": not self.refusal, "reason": self.refusal}
        if self.refusal:
            pass
        elif name == "arm":
            self.mode = "armed"
        elif name in ("disarm", "emergency"):
            self.mode, self.behavior, self.airborne = "ready", "ground", False
        elif name == "change_parameters":
            self._apply(from_parameters(request.parameters), request.requester)
            answer |= {"applied": request.parameters, "revision": self.revision}
        else:
            self.behavior = what
            self.airborne = True
            follow = {"take_off": "hover", "brake": "hover", "land": "ground"}.get(what)
            self.soon = (follow, 6) if follow else ("", 0)
        self.status()
        return new(f"{SERVICES[name]}_Response", **answer)

    def _run(self) -> None:
        count = 0
        while not self._closing.wait(0.02):
            count += 1
            if not self.beats:
                continue
            follow, left = self.soon
            if follow:
                self.soon = (follow, left - 1)
                if left == 0:
                    self.behavior, self.soon = follow, ("", 0)
                    if follow == "ground":
                        self.mode, self.airborne = "ready", False
                    self.status()
            now_ns = time.time_ns()
            ticks = np.zeros(5, TICK)
            ticks["imu"]["stamp_ns"] = now_ns + 2_000_000 * np.arange(-4, 1)
            ticks["state"]["quaternion_wb"][:, 0] = 1
            self._out["telemetry"].put(pack(ticks, count), now_ns)
            self._out["vehicle_heartbeat"].put(encode_heartbeat(count, now_ns), now_ns)
            if count % 5 == 0:
                self.status()


class Options(Parameters):
    pause: float = parameter(30.0, unit="s", ge=0, le=60, description="of the manoeuvre")
    kind: str = parameter(
        "wait", choices=("wait", "sticks", "manual", "source"), description="what"
    )


class Small:
    """Experiment that takes off, waits and lands."""

    name = "small"
    planned = 3.0

    def __init__(self, vehicle: str) -> None:
        self.parameters = Options()

    def check(self) -> None: ...

    def fly(self, client: Client) -> None:
        client.arm()
        client.start("take_off", height=1.0)
        client.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=5)
        kind = self.parameters.kind
        end = client.view().time + self.parameters.pause
        if kind == "source":
            client.change({"estimation.source": "bearings"})
            client.wait_until(
                lambda v: client.parameter("estimation.source") == "poses", what="it", timeout=10
            )
        elif kind == "sticks":
            client.start("velocity")
            while not client.finished:
                client.sticks((0.25, 0.0, 0.0, 0.0))
                client.wait(0.02)
        else:
            if kind == "manual":
                client.start("velocity")
                client.pilot_flies(True)
            client.wait_until(lambda v: v.time >= end or client.finished, what="it", timeout=40)
            client.pilot_flies(False)
        client.start("land")
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=5)

    def evaluate(self, log: Path) -> Result:
        raise NotImplementedError


class Vain(Small):
    """Experiment that waits in vain."""

    def fly(self, client: Client) -> None:
        client.arm()
        client.start("velocity")
        client.wait_until(lambda v: False, what="rain", timeout=0.3)


def offered(target: str, calibration: str = "") -> Offered[Experiment]:
    return Offered(Experiment(name="small", target=target, calibration=calibration), "")


class Bench(LinkedStation):
    """Vehicle, station and page, connected."""

    def __init__(self, data: Path) -> None:
        settings = {
            "station.recorder.after_disarm": 0.0,
            "station.recorder.keep_free": 10.0,
            "station.preflight.blocks": False,
        }
        super().__init__(data, settings)
        self.vehicle = ScriptedVehicle(self.at_vehicle)
        self.stick = self.page.advertise(TOPICS["stick"])
        self.told: list[Any] = []
        kind = TOPICS["experiment_status"].type_name
        self.page.subscribe(
            "experiment_status", kind, lambda r: self.told.append(decode(r.payload, kind))
        )

    def ready(self) -> bool:
        known = self.station.parts.vehicle_parameters._values
        return bool(known and self.station.experiments.feed.mode == "ready" and self.told)

    def close(self) -> None:
        self.vehicle.close()
        super().close()

    def start(self, name: str = "small", /, **options: Any) -> Any:
        return self.call("experiment", action="start", name=name, options=to_parameters(options))

    def do(self, action: str, requester: str = "ada") -> Any:
        return self.call("experiment", action=action, requester=requester)

    def flying(self, **options: Any) -> None:
        """Start the experiment, and return when its manoeuvre has begun."""
        answer = self.start(**options)
        assert answer.accepted, answer.reason
        step = {"sticks": "velocity", "manual": "waiting for it"}.get(options.get("kind", ""), "")
        assert until(lambda: self.told[-1].step == (step or "waiting for it")), self.told[-1]

    def ended(self) -> Any:
        """Return the status at the end, and not a late one of the experiment before."""

        def told() -> bool:
            now = self.station.experiments._state
            newest = self.told[-1]
            return now.phase in ENDED and (newest.phase, newest.reason) == (now.phase, now.reason)

        assert until(told), self.told[-1]
        return self.told[-1]

    def deflect(self, forward: float, enabled: bool = True) -> None:
        stamp_ns = time.time_ns()
        self.stick.put(encode_joy(stamp_ns, (forward, 0.0, 0.0, 0.0), enabled), stamp_ns)

    def take_over(self) -> Any:
        """Return the status after sticks were released and deflected.

        It is done again if a computer too busy to send them in time drops them.
        """

        def ended() -> bool:
            for forward, enabled in ((0.0, False), (0.5, True), (0.5, True)):
                self.deflect(forward, enabled)
                threading.Event().wait(0.02)
            return self.told[-1].phase in ENDED

        assert until(ended), self.told[-1]
        return self.told[-1]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    bench = Bench(tmp_path_factory.mktemp("data"))
    assert until(bench.ready), "vehicle, station and page did not find each other"
    yield bench
    bench.close()


@pytest.fixture
def bench(running: Bench, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setitem(experiments(), "small", offered(f"{__name__}:Small"))
    running.vehicle.reset()
    assert until(lambda: running.station.experiments.feed.mode == "ready")
    running.deflect(0.0, False)  # the dead-man of the test before
    running.vehicle.requests.clear()
    running.vehicle.joys.clear()
    running.told[:-1] = []
    for action in ("take", "release"):
        assert running.call("control", action=action).accepted
    yield running
    if running.told[-1].phase not in (*ENDED, "idle"):
        assert running.call("control", action="take").accepted
        running.do("stop")
        running.ended()
    running.vehicle.reset()
    assert until(lambda: not running.station.runs.recorder.run_id)
    assert running.station.runs.recorder.wait_idle(LIMIT)


def test_what_there_is_comes_with_bounds_choices_and_units(bench: Bench) -> None:
    answer = bench.do("describe")
    assert {"hover", "figure_eight", "bearings", "small"} <= set(answer.names)
    options = {d.name: d for d in map(from_descriptor, answer.descriptors)}
    duration, manoeuvre = options["bearings.duration"], options["bearings.manoeuvre"]
    assert (duration.minimum, duration.maximum, duration.unit) == (5.0, 3600.0, "s")
    assert "manual" in manoeuvre.choices
    assert all(answer.descriptions)


def test_an_experiment_that_cannot_be_imported_is_listed_with_the_reason(bench: Bench) -> None:
    """The others can be flown all the same."""
    broken = Experiment(name="small", target="nowhere.small:Small", calibration="small")
    of = Extension(name="tunnel", summary="", protocol=1, offers=(broken,))
    experiments()["small"] = Offered(broken, "", of)
    answer = bench.do("describe")
    listed = {
        name: (problem, calibration)
        for name, problem, calibration in zip(
            answer.names, answer.problems, answer.calibrations, strict=True
        )
    }
    problem, calibration = listed["small"]
    assert "extension tunnel: experiment small cannot be imported: ModuleNotFoundError" in problem
    assert calibration == ""
    assert listed["hover"] == ("", "")
    assert listed["motor_bench"] == ("", "motor")
    assert bench.start("small").reason == problem


@pytest.mark.parametrize(
    ("name", "options", "said"),
    [
        ("loop", {}, "unknown experiment 'loop'; there are"),
        ("bearings", {"duration": 1.0}, "allowed 5 to 3600 s"),
        ("bearings", {"estimator": "magic"}, "one of error_state, complementary"),
        ("bearings", {"manouvre": "hover"}, "did you mean manoeuvre"),
        ("bearings", {"gains": "paper"}, "of the complementary filter"),
        ("bearings", {"manoeuvre": "sticks", "sticks_file": "/none.csv"}, "cannot be read"),
        ("hover", {"height": 2.0}, "hover has no options"),
    ],
)
def test_wrong_options_are_refused_and_nothing_is_started(
    bench: Bench, name: str, options: dict[str, Any], said: str
) -> None:
    answer = bench.start(name, **options)
    assert not answer.accepted
    assert said in answer.reason
    assert bench.vehicle.requests == []
    assert not bench.station.experiments._state.running
    assert not bench.do("stop").accepted
    assert not bench.do("finish").accepted


def test_a_flight_is_commanded_in_the_starters_name_and_its_run_kept_when_it_cannot_be_judged(
    bench: Bench,
) -> None:
    answer = bench.start(pause=0.3)
    assert answer.accepted, answer.reason
    done = bench.ended()
    wanted = [("arm", ""), ("start_behavior", "take_off"), ("start_behavior", "land")]
    assert bench.vehicle.requests == [(*what, "ada") for what in wanted]
    phases = list(dict.fromkeys(m.phase for m in bench.told))
    assert phases[-3:] == ["flying", "evaluating", "failed"]
    assert (done.name, done.requester, done.planned) == ("small", "ada", 3.0)
    # The process that judges cannot load an experiment of this file.
    assert (
        "not judged: the evaluation of small failed: its process ended with status 1" in done.reason
    )
    assert f"run {done.run_id} is kept" in done.reason
    entry = bench.catalogue.get(done.run_id)
    assert (entry.complete, entry.operator) == (True, "ada")
    assert any(m.run_id == done.run_id and m.phase == "flying" for m in bench.told)


def test_a_repeated_start_has_one_effect_and_another_one_is_refused(bench: Bench) -> None:
    fields = {"action": "start", "name": "small", "options": to_parameters({"pause": 20.0})}
    for _ in range(2):
        assert bench.call("experiment", request_id="same", **fields).accepted
    second = bench.start()
    assert not second.accepted
    assert "small is running, started by ada; stop it first" in second.reason
    assert until(lambda: bench.told[-1].step == "waiting for it")
    assert [s for s, _, _ in bench.vehicle.requests].count("arm") == 1


def test_on_a_vehicle_that_is_not_ready_nothing_is_started(bench: Bench) -> None:
    bench.vehicle.mode = "armed"
    bench.vehicle.status()
    assert until(lambda: bench.station.experiments.feed.mode == "armed")
    answer = bench.start()
    assert not answer.accepted
    assert "the vehicle is armed" in answer.reason
    assert bench.vehicle.requests == []


def test_a_status_that_arrives_late_starts_it_and_one_that_never_comes_does_not(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed, waited = bench.station.experiments.feed, threading.Event()
    received, waiting = feed.status, feed._news.wait_for

    def wait_for(*args: Any) -> Any:
        waited.set()
        return waiting(*args)

    def late(status: Any) -> None:
        if waited.is_set():
            received(status)

    monkeypatch.setattr(feed, "status", late)  # nothing arrives until somebody waits for it
    assert until(lambda: not feed.mode)
    monkeypatch.setattr(feed._news, "wait_for", wait_for)
    assert bench.start().accepted
    assert bench.do("stop").accepted
    bench.ended()
    monkeypatch.setattr(feed, "status", lambda status: None)
    assert until(lambda: not feed.mode)
    assert bench.start().reason.startswith("the vehicle is silent; an experiment starts on the")


def test_what_the_vehicle_refuses_on_the_ground_is_told_with_its_reason(bench: Bench) -> None:
    bench.vehicle.refusal = "not armed: battery at 12.0 V"
    assert bench.start().accepted
    done = bench.ended()
    assert (done.phase, done.reason) == ("refused", "not armed: battery at 12.0 V")
    assert bench.vehicle.requests == [("arm", "", "ada")]


@pytest.mark.parametrize(
    ("service", "fields"),
    [
        ("start_behavior", {"name": "land"}),
        ("start_behavior", {"name": "brake"}),
        ("emergency", {"action": "land"}),
        ("disarm", {}),
    ],
)
def test_a_persons_command_ends_it_and_nothing_more_is_sent(
    bench: Bench, service: str, fields: dict[str, str]
) -> None:
    bench.flying(kind="sticks")
    assert until(lambda: bench.vehicle.joys)
    assert bench.call("control", action="take", requester="grace").accepted
    bench.call(service, requester="grace", **fields)
    at = next(i for i, r in enumerate(bench.vehicle.requests) if r[2] == "grace")
    joys = len(bench.vehicle.joys)
    done = bench.ended()
    assert (done.phase, done.verdict) == ("stopped", "")
    assert done.reason == f"grace took over with {service.replace('_', ' ')}"
    threading.Event().wait(0.3)
    assert bench.vehicle.requests[at + 1 :] == []
    assert len(bench.vehicle.joys) <= joys + 1  # one may have been in transit


def test_parameters_changed_by_a_person_do_not_end_it(bench: Bench) -> None:
    bench.flying()
    values = to_parameters({"position.kp_xy": 5.0})
    assert bench.call("control", action="take", requester="grace").accepted
    assert bench.call("change_parameters", parameters=values, requester="grace").accepted
    threading.Event().wait(0.2)
    assert bench.told[-1].phase == "flying"


def test_deflected_sticks_take_over_and_held_but_centred_ones_do_not(bench: Bench) -> None:
    bench.flying()
    have = len(bench.vehicle.joys)
    for _ in range(10):
        bench.deflect(0.0)
        threading.Event().wait(0.02)
    assert bench.told[-1].phase == "flying"
    assert len(bench.vehicle.joys) == have, "sticks must not mix with those of an experiment"
    done = bench.take_over()
    assert (done.phase, done.reason) == ("stopped", "the sticks took over")
    assert until(lambda: bench.vehicle.requests[-1] == ("start_behavior", "velocity", "the sticks"))
    assert until(lambda: any(j.axes[0] == 0.5 for j in bench.vehicle.joys[have:]))


def test_sticks_that_took_over_ask_for_it_once_and_fly_from_then_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long the experiment takes to end; also for centred sticks."""
    runner, proceed = bench.station.experiments, threading.Event()
    leave = runner._end_early
    monkeypatch.setattr(runner, "_end_early", lambda *a: (proceed.wait(LIMIT), leave(*a)))
    bench.flying()

    def asked() -> list[Any]:
        return [one for one in bench.vehicle.requests if one[2] == "the sticks"]

    def flown(forward: float) -> bool:
        bench.deflect(forward)
        threading.Event().wait(0.02)
        joys = list(bench.vehicle.joys)
        return any(joy.axes[0] == forward and joy.enabled for joy in joys)

    try:
        bench.deflect(0.0, False)
        assert until(lambda: flown(0.5) and asked())
        for forward in (0.625, 0.0, 0.75):
            assert until(partial(flown, forward))
        assert asked() == [("start_behavior", "velocity", "the sticks")]
    finally:
        proceed.set()
    assert bench.ended().reason == "the sticks took over"


def test_sticks_take_over_behind_a_command_of_the_experiment_that_is_on_its_way(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("console.experiment_running.runner.SETTLE", LIMIT)
    bench.flying()
    client = bench.station.experiments._client
    assert client is not None
    with client._sending:
        assert bench.take_over().reason == "the sticks took over"
        assert until(lambda: any(joy.axes[0] == 0.5 for joy in list(bench.vehicle.joys)))
        assert not [one for one in bench.vehicle.requests if one[2] == "the sticks"]
    assert until(lambda: bench.vehicle.requests[-1] == ("start_behavior", "velocity", "the sticks"))


def test_sticks_do_not_change_what_a_person_has_just_commanded(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    runner, proceed = bench.station.experiments, threading.Event()
    leave = runner._end_early
    monkeypatch.setattr(runner, "_end_early", lambda *a: (proceed.wait(LIMIT), leave(*a)))
    bench.flying()
    assert bench.call("start_behavior", name="land").accepted
    bench.deflect(0.0, False)

    def flown() -> bool:
        bench.deflect(0.5)
        threading.Event().wait(0.02)
        return any(joy.axes[0] == 0.5 for joy in list(bench.vehicle.joys))

    try:
        assert until(flown)
    finally:
        proceed.set()
    assert bench.ended().reason == "ada took over with start behavior"
    assert bench.vehicle.requests[-1] == ("start_behavior", "land", "ada")


def test_sticks_deflected_since_before_the_start_take_nothing_over(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A busy computer may send nothing for longer, which would count as a release.
    monkeypatch.setattr(stick_takeover, "SILENT", 30.0)
    stop = threading.Event()

    def hold() -> None:
        while not stop.wait(0.02):
            bench.deflect(0.5)

    def flown() -> bool:
        bench.deflect(
            0.0, False
        )  # sticks that a busy computer sent too late are dropped until then
        bench.deflect(0.5)
        return any(joy.axes[0] == 0.5 for joy in list(bench.vehicle.joys))

    holding = threading.Thread(target=hold, daemon=True)
    assert until(flown)
    holding.start()
    try:
        # A release that was sent before may still be on its way.
        assert until(lambda: [joy.axes[0] for joy in list(bench.vehicle.joys)[-5:]] == [0.5] * 5)
        bench.flying()
        threading.Event().wait(0.1)
        assert bench.told[-1].phase == "flying"
    finally:
        stop.set()
        holding.join()
    assert bench.take_over().reason == "the sticks took over"


def test_by_hand_the_persons_sticks_fly_until_finish_and_held_ones_take_nothing_over(
    bench: Bench,
) -> None:
    bench.flying(kind="manual")
    assert until(lambda: bench.told[-1].manual)
    have = len(bench.vehicle.joys)
    finished = False
    for _ in range(400):
        bench.deflect(0.75)
        threading.Event().wait(0.02)
        if not finished and len(bench.vehicle.joys) > have + 5:
            finished = bool(bench.do("finish").accepted)
        if bench.told[-1].phase in ("evaluating", *ENDED):
            break
    assert any(joy.axes[0] == 0.75 for joy in bench.vehicle.joys[have:])
    assert bench.vehicle.requests[-1] == ("start_behavior", "land", "ada")
    assert bench.ended().phase == "failed"  # flown to its end; not judged, as it is of this file
    assert "finishing" in {m.phase for m in bench.told}


def test_stop_brakes_in_the_name_of_who_stops_and_sends_nothing_more(bench: Bench) -> None:
    bench.flying()
    assert bench.call("control", action="take", requester="grace").accepted
    assert bench.do("stop", "grace").accepted
    done = bench.ended()
    assert done.phase == "stopped"
    assert done.reason == "stopped by grace; it brakes and hovers; land it"
    assert bench.vehicle.requests[-1] == ("start_behavior", "brake", "grace")
    have = len(bench.vehicle.requests)
    threading.Event().wait(0.3)
    assert len(bench.vehicle.requests) == have


def test_the_vehicles_own_decision_is_seen_by_the_experiment(bench: Bench) -> None:
    bench.flying(kind="source")
    bench.vehicle.falls_back()
    assert until(lambda: bench.vehicle.requests[-1] == ("start_behavior", "land", "ada"))


def test_a_lost_link_ends_it_and_nothing_is_sent_when_it_is_back(bench: Bench) -> None:
    bench.flying()
    have = len(bench.vehicle.requests)
    bench.vehicle.beats = False
    done = bench.ended()
    bench.vehicle.beats = True
    assert done.phase == "stopped"
    assert "the link to the vehicle was lost" in done.reason
    assert until(lambda: bench.station.experiments.feed.mode == "armed")
    threading.Event().wait(0.3)
    assert len(bench.vehicle.requests) == have
    bench.vehicle.reset()


@pytest.mark.parametrize(
    ("prefix", "kinds"),
    [("", {EventKind.BRAKING}), (DELAYED_PREFIX, {EventKind.BRAKING, EventKind.DELAYED})],
)
def test_a_vehicle_that_brakes_by_itself_ends_it_and_is_held(
    bench: Bench, prefix: str, kinds: set[EventKind]
) -> None:
    bench.flying()
    line = f"{prefix}braking: no heartbeat from the station for 0.40 s"
    bench.vehicle.say("braking: but of words alone")
    bench.vehicle.say(line, *kinds)
    done = bench.ended()
    assert done.phase == "stopped"
    assert done.reason == (
        "the vehicle braked by itself: no heartbeat from the station for 0.40 s; it brakes and "
        "hovers; land it"
    )
    assert bench.vehicle.requests[-1] == ("start_behavior", "brake", "ada")


def test_a_vehicle_that_starts_anew_ends_it_and_nothing_more_is_sent(bench: Bench) -> None:
    bench.flying()
    have, vehicle = len(bench.vehicle.requests), bench.vehicle
    vehicle.instance, vehicle.mode, vehicle.behavior = 2, "starting", "ground"  # never silent
    vehicle.status()
    done = bench.ended()
    assert done.phase == "stopped"
    assert done.reason.startswith("the vehicle's processes have started anew")
    assert len(vehicle.requests) == have
    vehicle.reset()


def test_motors_that_are_cut_end_it_at_once_and_nothing_more_is_sent(bench: Bench) -> None:
    bench.flying()
    have = len(bench.vehicle.requests)
    bench.vehicle.mode, bench.vehicle.behavior, bench.vehicle.airborne = "cut", "ground", False
    bench.vehicle.status()
    done = bench.ended()
    assert (done.phase, done.reason) == ("failed", "the motors were cut while it waited for it")
    assert len(bench.vehicle.requests) == have


def test_a_wait_in_vain_ends_hovering_with_the_reason(bench: Bench) -> None:
    experiments()["small"] = offered(f"{__name__}:Vain")
    assert bench.start().accepted
    done = bench.ended()
    assert done.phase == "failed"
    assert (
        "timed out after 0.3 s waiting for rain; the vehicle is armed, velocity; it brakes"
        in done.reason
    )
    assert bench.vehicle.requests[-1] == ("start_behavior", "brake", "ada")


def test_the_status_is_sent_again_while_nothing_happens(bench: Bench) -> None:
    have = len(bench.told)
    assert until(lambda: len(bench.told) > have + 1, 5.0)


def test_a_terminal_commands_as_a_person_with_control_and_gives_it_up(bench: Bench) -> None:
    with station(bench.loopback, "quad1") as terminal:
        told = terminal.ask("experiment", action="describe")
        assert len(told.names) == len(told.calibrations) == len(told.problems)
        assert terminal.parameters() == bench.vehicle.values_
        with pytest.raises(RefusedError, match="the vehicle's calibrations are not known"):
            terminal.ask("calibrate", action="history")
        terminal.ask("experiment", action="start", name="small")
        assert until(lambda: terminal.statuses.get(timeout=LIMIT).requester == terminal.requester)
        refused = bench.do("stop", "grace").reason
        assert refused.startswith(f"{terminal.requester} has control")
        terminal.ask("experiment", action="stop")
        bench.ended()
    assert (
        bench.do("stop", "grace").reason == "no experiment is running, so there is nothing to stop"
    )
