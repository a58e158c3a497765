"""A motor on the bench is requested repeatedly during its experiment, and never afterwards."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from console.experiment_running import live_bench
from console.experiment_running.live_bench import LiveBench
from quadrotor.errors import LinkError, RefusedError

BOUND = 10.0


class Vehicle:
    """The part of a vehicle that the bench uses; `answers` raises instead of accepting."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, int]] = []
        self.ends = 0
        self.error: Exception | None = None
        self.mode, self.looked, self.timeout = "bench", float("inf"), BOUND
        self.news = threading.Condition()

    def ask(self, motor: int, reference: int) -> None:
        with self.news:
            self.asked.append((motor, reference))
            self.news.notify_all()
        if self.error is not None:
            raise self.error

    def end(self) -> None:
        with self.news:
            self.ends += 1
            self.news.notify_all()

    def until(self, condition: Callable[[], Any]) -> bool:
        with self.news:
            return bool(self.news.wait_for(condition, BOUND))


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


@pytest.fixture
def bench(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> Iterator[LiveBench]:
    monkeypatch.setattr(live_bench, "PERIOD", 0.01)
    monkeypatch.setattr(live_bench, "SHOWN", 0.0)
    made = LiveBench(
        vehicle.ask,
        vehicle.end,
        lambda: vehicle.timeout,
        lambda: vehicle.mode,
        lambda: min(vehicle.looked, time.monotonic()),
    )
    yield made
    made.close()


def test_it_is_asked_for_again_with_the_newest_reference(
    bench: LiveBench, vehicle: Vehicle
) -> None:
    bench.set(1, 30)
    assert vehicle.until(lambda: vehicle.asked.count((1, 30)) > 3)
    bench.set(1, 40)
    have = len(vehicle.asked)
    assert vehicle.until(lambda: len(vehicle.asked) > have + 3)
    assert set(vehicle.asked[have:]) == {(1, 40)}
    assert (vehicle.ends, bench.problem) == (0, None)


@pytest.mark.parametrize("way", ["close", "give_up", "zero"])
def test_every_way_out_stops_the_motor_and_asks_no_more(
    bench: LiveBench, vehicle: Vehicle, way: str
) -> None:
    bench.set(2, 100)
    bench.set(0, 0) if way == "zero" else getattr(bench, way)()
    assert vehicle.until(lambda: vehicle.ends == 1)
    have = len(vehicle.asked)
    bench.close()
    assert (len(vehicle.asked), vehicle.ends) == (have, 1)
    with pytest.raises(RefusedError, match="the experiment is over"):
        bench.set(1, 30)
    assert len(vehicle.asked) == have


def test_without_a_motor_nothing_is_sent_at_the_end(bench: LiveBench, vehicle: Vehicle) -> None:
    bench.set(0, 0)
    bench.close()
    assert (vehicle.asked, vehicle.ends) == ([], 0)


def test_what_the_vehicle_refuses_is_raised_and_not_asked_again(
    bench: LiveBench, vehicle: Vehicle
) -> None:
    vehicle.error = RefusedError("bench refused: airborne")
    with pytest.raises(RefusedError, match="airborne"):
        bench.set(1, 30)
    assert not bench.is_on
    bench.close()
    assert (vehicle.asked, vehicle.ends) == ([(1, 30)], 0)


def test_an_answer_that_is_missed_once_does_not_end_it(bench: LiveBench, vehicle: Vehicle) -> None:
    bench.set(1, 30)
    vehicle.error = LinkError("no answer")
    have = len(vehicle.asked)
    assert vehicle.until(lambda: len(vehicle.asked) > have + 2)
    vehicle.error = None
    have = len(vehicle.asked)
    assert vehicle.until(lambda: len(vehicle.asked) > have + 2)
    assert (bench.problem, bench.is_on, vehicle.ends) == (None, True, 0)


@pytest.mark.parametrize(
    ("what", "value", "said"),
    [
        ("timeout", 0.05, "did not answer for"),
        ("mode", "ready", "the vehicle has ended the bench; it is ready"),
        ("looked", -1e9, "did not read its client"),
        ("error", RefusedError("the vehicle turned by 30°"), "turned by 30°"),
    ],
)
def test_a_motor_that_has_stopped_or_that_nobody_watches_is_not_started_again(
    bench: LiveBench, vehicle: Vehicle, what: str, value: Any, said: str
) -> None:
    if what == "timeout":
        vehicle.timeout = value
    bench.set(1, 30)
    if what == "timeout":
        vehicle.error = LinkError("no answer")
    else:
        setattr(vehicle, what, value)
    assert vehicle.until(lambda: vehicle.ends == 1)
    vehicle.error = None
    have = len(vehicle.asked)
    assert said in str(bench.problem)
    assert not bench.is_on
    bench.close()
    assert (len(vehicle.asked), vehicle.ends) == (have, 1)
