"""Comparison over a real session: published, recorded, changed and refused at the station."""

from __future__ import annotations

import math
import os
import pickle
import signal
import threading
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bearing_sim import BearingEmulator, BearingMeasurement, BearingParameters, PoseMeasurement
from console.parameters.store import StationStore
from estimation import names, registry
from extensions.comparison import feed as comparison_feed
from extensions.comparison.feed import ComparisonFeed
from extensions.comparison.kernels import CompiledEstimators
from extensions.comparison.parameters import ComparisonParameters, parse_estimators
from extensions.comparison.process import ComparisonWorker
from flight_log import read_log
from quadrotor.errors import OutOfBoundsError
from quadrotor.records import TICK
from tests.waiting import until
from vehicle_link.messages import decode
from vehicle_link.telemetry import pack
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

LIMIT = 20.0
NAME = "station.comparison.estimators"
TYPE = TOPICS["comparison"].type_name


class Heard:
    """Receiver of the newest comparison."""

    def __init__(self, node: Node) -> None:
        self._got: list[Received] = []
        node.subscribe("comparison", TYPE, self._got.append)

    def count(self) -> int:
        return len(self._got)

    def since(self, vehicle_ns: int) -> int:
        """Return how many are of a later time: a busy computer delivers others late."""
        return sum(received.source_ns > vehicle_ns for received in self._got)

    def newest(self) -> Any:
        return decode(self._got[-1].payload, TYPE)

    def names(self) -> list[str]:
        return [one.name for one in self.newest().estimators] if self.count() else []


def test_the_vehicles_own_estimate_is_told_again_and_again_and_recorded(linked: Any) -> None:
    heard = Heard(linked.page)
    linked.connect()
    assert until(lambda: heard.count() > 5)
    message = heard.newest()
    [own] = message.estimators
    assert own.name == "vehicle"
    assert message.truth == ""
    assert math.isnan(own.position_error)
    run = linked.call("record", start=True).run_id
    begun_ns = linked.station.link.vehicle_ns()
    assert until(lambda: heard.since(begun_ns) > 3)
    assert linked.call("record", start=False).accepted
    assert linked.station.runs.recorder.wait_idle(LIMIT)
    recorded = list(read_log(linked.catalogue.resolve(run)))
    assert sum(one.topic == "/quad1/comparison" for one in recorded) >= 2


def test_the_set_changes_while_it_runs_and_wrong_names_change_nothing(linked: Any) -> None:
    heard = Heard(linked.page)

    def change(text: str) -> Any:
        return linked.change(NAME, text)

    if linked.vehicle is None:
        linked.connect()
    assert change("error_state complementary:paper").accepted
    wanted = ["vehicle", "error_state", "complementary:paper"]
    assert until(lambda: heard.names() == wanted)
    refused = change("error_state nobody")
    assert not refused.accepted
    assert "'nobody'" in refused.reason
    assert "complementary, error_state" in refused.reason
    before = heard.count()
    assert until(lambda: heard.count() > before)
    assert heard.names() == wanted
    assert change("").accepted
    assert until(lambda: heard.names() == ["vehicle"])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("kalman", "'kalman' is not one; allowed are complementary, error_state"),
        ("complementary:fast", "a preset \\(paper, bearings, resolved\\)"),
        ("complementary:", "'complementary:' is not one"),
        ("error_state error_state", "'error_state' twice"),
        (
            "error_state complementary error_state:paper error_state:bearings "
            "error_state:resolved complementary:paper complementary:bearings",
            "are 7; allowed are at most 6",
        ),
    ],
)
def test_wrong_texts_are_refused_with_what_is_allowed(text: str, reason: str) -> None:
    store = StationStore()
    store.change({NAME: "error_state"}, "ada")
    with pytest.raises(OutOfBoundsError, match=reason):
        store.change({NAME: text, "station.bearings.sigma": 3.0}, "ada")
    assert store.values()[NAME] == "error_state"
    assert store.parameters.bearings.sigma == 1.5


def test_words_are_taken_apart_with_the_presets_they_stand_for() -> None:
    choices = parse_estimators("  error_state  complementary complementary:paper ")
    assert [tuple(one) for one in choices] == [
        ("error_state", "error_state", ""),
        ("complementary", "complementary", "resolved"),
        ("complementary:paper", "complementary", "paper"),
    ]


def test_a_process_that_dies_is_said_and_started_again(
    linked: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    if linked.vehicle is None:
        linked.connect()
    heard = Heard(linked.page)
    feed = linked.station.parts.added.by_name["comparison"]
    assert until(lambda: heard.count() > 2)
    monkeypatch.setattr(comparison_feed, "RESTART_PERIOD", 0.0)
    said: list[str] = []
    monkeypatch.setattr(feed, "_say", said.append)
    os.kill(feed._child.pid, signal.SIGKILL)
    assert until(lambda: len(said) == 1)
    assert "its process was killed by SIGKILL" in said[0]
    before = heard.count()
    assert until(lambda: heard.count() > before + 2)
    assert heard.names() == ["vehicle"]


def test_a_defect_in_one_message_is_said_once_and_the_rest_is_taken() -> None:
    said: list[str] = []
    told: list[bytes] = []
    worker = ComparisonWorker(lambda payload, stamp_ns: told.append(payload), said.append)
    ticks = np.zeros(5, TICK)
    ticks["state"]["quaternion_wb"][:, 0] = 1.0
    for k in range(4):
        ticks["imu"]["stamp_ns"] = 10_000_000 * k + 2_000_000 * np.arange(1, 6)
        worker.process(("", [("telemetry", b"nothing"), ("telemetry", pack(ticks, k))]))
    worker.close()
    assert len(told) == 4  # every batch
    assert len(said) == 1
    assert "too few for a telemetry packet" in said[0]


def test_a_worker_starts_what_is_named_and_stops_what_no_longer_is() -> None:
    """The messages are pickled as between the processes."""
    registry.prepare("error_state", bearings=True)
    told: list[Any] = []
    worker = ComparisonWorker(lambda payload, stamp_ns: told.append(decode(payload, TYPE)), print)
    emulator = BearingEmulator(BearingParameters(sigma=0.1))
    here, level = np.array([0.3, 0.2, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])
    ticks = np.zeros(5, TICK)
    ticks["imu"]["specific_force_b"] = 0.0, 0.0, 9.81
    ticks["state"]["position_w"], ticks["state"]["quaternion_wb"] = here, level
    count = 0

    def flown(text: str) -> Any:
        nonlocal count
        count += 1
        stamps = 10_000_000 * count + 2_000_000 * np.arange(5)
        ticks["imu"]["stamp_ns"] = stamps
        now_ns = int(stamps[-1])
        emulator.observe(now_ns, here, level)
        items: list[tuple[Any, ...]] = [("bearings", frame) for frame in emulator.due(now_ns)]
        items += [("truth", now_ns, here, level), ("telemetry", pack(ticks, count))]
        worker.process(pickle.loads(pickle.dumps((text, items))))
        return told[-1].estimators[-1] if told else None

    assert until(lambda: (last := flown("error_state")) and last.initialized)
    assert flown("error_state").name == "error_state"
    assert flown("error_state").position_error < 0.05
    flown("")
    flown("")
    assert [one.name for one in told[-1].estimators] == ["vehicle"]
    worker.close()


def test_an_estimator_that_only_the_station_knows_is_said_and_changes_nothing() -> None:
    said: list[str] = []
    worker = ComparisonWorker(lambda payload, stamp_ns: None, said.append)
    for _ in range(3):
        worker.process(("theirs", []))
    worker.close()
    assert len(said) == 1
    assert said[0].startswith("not compared: estimators = 'theirs': 'theirs' is not one")


def test_the_feed_hands_everything_over_in_its_order(monkeypatch: pytest.MonkeyPatch) -> None:
    feed = ComparisonFeed(ComparisonParameters(), lambda *_: None, lambda line: None)
    monkeypatch.setattr(feed, "_alive", lambda: False)
    frame = BearingMeasurement(3, np.array([1]), np.array([[0.0, 0.0, 1.0]]), 0.02)
    feed.truth(1, np.zeros(3), np.ones(4))
    feed.pose(PoseMeasurement(2, np.zeros(3), np.ones(4)))
    feed.bearings(frame)
    feed.status(True, True)
    feed.telemetry(b"packet")
    took = list(feed._queue)
    feed.close()
    assert [one[0] for one in took] == ["truth", "tracker", "bearings", "status", "telemetry"]
    assert took[1][1] == 2
    assert took[2][1] is frame
    assert took[3][1:] == (True, True)


def test_the_end_of_the_process_is_not_said_when_the_station_ends() -> None:
    said: list[str] = []
    for _ in range(5):  # the feed's thread may notice the end before it closes itself
        feed = ComparisonFeed(ComparisonParameters(), lambda *_: None, said.append)
        feed.telemetry(b"packet")
        assert until(partial(getattr, feed, "_child"))
        feed.close()
    assert said == []


def test_an_estimator_that_cannot_be_prepared_is_said_once(monkeypatch: Any) -> None:
    said: list[str] = []
    told = threading.Event()

    def say(line: str) -> None:
        said.append(line)
        told.set()

    def broken(parameters: Any) -> Any:
        raise RuntimeError("no such sensor")

    monkeypatch.setitem(names.registered, "broken", broken)
    kernels = CompiledEstimators(say)
    assert not kernels.ready("broken")
    assert told.wait(LIMIT)
    kernels.close()
    assert not kernels.ready("broken")
    fails = "the estimator broken fails at rest: RuntimeError: no such sensor; mend it"
    assert said == [f"comparing broken: {fails}"]


@pytest.mark.parametrize(
    ("values", "fine"),
    [
        ({"range_min": 5.0}, True),
        ({"range_max": 0.1}, True),
        ({"range_min": 5.0, "range_max": 5.0}, True),
        ({"range_min": 10.0, "range_max": 9.9}, False),
        ({"range_max": 9.9, "range_min": 10.0}, False),
    ],
)
def test_the_ranges_of_the_sensor_are_checked_together(values: Any, fine: bool) -> None:
    store = StationStore()
    names = {f"station.bearings.{name}": value for name, value in values.items()}
    if fine:
        store.change(names, "ada")
        return
    with pytest.raises(OutOfBoundsError, match=r"range_min = 10 m exceeds range_max = 9.9 m"):
        store.change(names, "ada")
    bearings = store.parameters.bearings
    assert (bearings.range_min, bearings.range_max) == (0.05, 20.0)


def test_each_range_alone_is_refused_beyond_the_other_and_both_at_once_may_pass_it() -> None:
    store = StationStore()
    low, high = "station.bearings.range_min", "station.bearings.range_max"
    store.change({high: 2.0}, "ada")
    with pytest.raises(OutOfBoundsError, match="range_min = 3 m exceeds range_max = 2 m"):
        store.change({low: 3.0}, "ada")
    store.change({low: 3.0, high: 4.0}, "ada")  # the first alone would be refused
    with pytest.raises(OutOfBoundsError, match="range_min = 3 m exceeds range_max = 1 m"):
        store.change({high: 1.0}, "ada")
    store.change({high: 1.0, low: 0.5}, "ada")
    bearings = store.parameters.bearings
    assert (bearings.range_min, bearings.range_max) == (0.5, 1.0)


def test_estimators_are_compared_only_while_somebody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("CHECK_PERIOD", 0.0), ("LINGER", 0.01)):
        monkeypatch.setattr(comparison_feed, name, value)
    looking = threading.Event()
    comparison = ComparisonFeed(
        ComparisonParameters(), lambda *_: None, lambda _: None, looking.is_set
    )
    try:
        comparison.telemetry(b"")
        assert until(lambda: not comparison._queue), "what nobody wants is not kept"
        assert comparison._child is None
        looking.set()
        comparison.telemetry(b"")
        child = until(lambda: comparison._child)
        assert child is not None
        process = Path(f"/proc/{child.pid}")
        assert process.exists()
        looking.clear()
        assert until(lambda: comparison._child is None and not process.exists())
    finally:
        comparison.close()
