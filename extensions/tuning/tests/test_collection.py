"""Answers of the vehicle's log are assembled, and passed on by a real station."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from console.link.forwarding import forward_service
from extensions.tuning.collection import EMPTY_ANSWERS_MAX, Collection
from quadrotor.errors import StorageError
from tests.support.narrowing import now
from vehicle_link.messages import new
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.idempotent import answering

TYPE = SERVICES["onboard_log"]
STEP = 2_000_000
START, END = 1000 * STEP, 2000 * STEP
NAMES = ("a", "b")


def answer(first: int, last: int, *, complete: bool = False, damaged: int = 0) -> Any:
    stamps = STEP * np.arange(first, last + 1, dtype=np.int64)
    values = np.stack([np.arange(first, last + 1)] * 2, axis=1).astype(np.float32)
    return SimpleNamespace(
        stamps_ns=stamps, values=values.ravel(), complete=complete, damaged=damaged, file="f.mcap"
    )


def test_each_question_goes_on_where_the_last_answer_ended() -> None:
    collection = Collection(NAMES, START, END)
    assert collection.question["start_ns"] == START
    collection.add(answer(1000, 1399))
    assert collection.question["start_ns"] == 1399 * STEP + 1
    assert collection.question["end_ns"] == END
    assert collection.share == pytest.approx(0.399, abs=0.001)
    assert not collection.done
    collection.add(answer(1400, 2000))
    assert now(collection).done
    samples = collection.result()
    assert samples.stamps_ns.tolist() == [STEP * k for k in range(1000, 2001)]
    assert samples.values["b"].tolist() == list(range(1000, 2001))
    assert samples.gaps == ()
    assert samples.rate == pytest.approx(500.0)
    assert (samples.problem, samples.file) == ("", "f.mcap")


def test_after_a_failure_it_is_asked_again_from_the_same_place() -> None:
    collection = Collection(NAMES, START, END)
    collection.add(answer(1000, 1399))
    before = collection.question
    assert collection.failed("the link is lost")
    assert collection.question == before
    collection.add(answer(1400, 2000))
    assert collection.result().gaps == ()


def test_it_gives_up_after_some_failures_and_keeps_what_came() -> None:
    collection = Collection(NAMES, START, END)
    collection.add(answer(1000, 1499))
    for _ in range(EMPTY_ANSWERS_MAX - 1):
        assert collection.failed("the link is lost")
    assert not collection.failed("the link is lost")
    assert now(collection).done
    samples = collection.result()
    assert samples.problem == "the link is lost"
    [gap] = samples.gaps
    assert (gap.start, gap.end) == pytest.approx((0.998, 2.0))


def test_nothing_at_all_is_an_error_with_its_reason() -> None:
    collection = Collection(NAMES, START, END)
    while collection.failed("nobody serves it"):
        pass
    with pytest.raises(StorageError, match=r"could not be read: nobody serves it"):
        collection.result()


def test_ticks_that_are_missing_are_gaps() -> None:
    collection = Collection(NAMES, START, END)
    collection.add(answer(1000, 1199))
    collection.add(answer(1250, 1700))
    collection.add(answer(1703, 1900, complete=True))
    gaps = [(round(g.start, 3), round(g.end, 3)) for g in collection.result().gaps]
    assert gaps == [(0.398, 0.5), (1.4, 1.406), (1.8, 2.0)]


def test_a_late_first_tick_is_a_gap_too() -> None:
    collection = Collection(NAMES, START, END)
    collection.add(answer(1100, 2000))
    [gap] = collection.result().gaps
    assert (gap.start, gap.end) == pytest.approx((-0.2, 0.0))


def test_two_lost_ticks_are_a_gap_one_is_counted_and_jitter_is_neither() -> None:
    collection = Collection(NAMES, START, END)
    ticks = answer(1000, 2000)
    ticks.stamps_ns[1:-1] += np.random.default_rng(3).integers(-500_000, 500_000, 999)
    collection.add(ticks)
    assert (collection.result().gaps, collection.result().single) == ((), 0)
    collection = Collection(NAMES, START, END)
    collection.add(answer(1000, 1500))
    collection.add(answer(1502, 1600))
    collection.add(answer(1603, 2000))
    found = collection.result()
    assert (len(found.gaps), found.single) == (1, 1)


@pytest.mark.parametrize(
    "change",
    [
        {"values": np.zeros(3, np.float32)},
        {"stamps_ns": np.array([STEP * 1000, STEP * 1000, STEP * 1001])},
        {"stamps_ns": np.array([STEP * 999, STEP * 1000, STEP * 1001])},
        {"stamps_ns": np.array([STEP * 1999, STEP * 2000, STEP * 2001])},
    ],
)
def test_an_answer_that_does_not_fit_the_question_is_refused(change: Any) -> None:
    wrong = answer(1000, 1002)
    vars(wrong).update(change)
    with pytest.raises(StorageError, match="do not answer a request for 2 columns"):
        Collection(NAMES, START, END).add(wrong)


def test_damage_is_told() -> None:
    collection = Collection(NAMES, START, END)
    collection.add(answer(1000, 2000, damaged=2))
    assert "2 blocks of the vehicle's log are damaged" in collection.result().problem


class FakeNode:
    """Node that serves and calls in one process, like vehicle_link.transport.node.Node."""

    def __init__(self) -> None:
        self.asked: list[Any] = []
        self.priority = ""

    def client(self, name: str, srv_type: str, *, priority: str) -> Any:
        assert (name, srv_type) == ("onboard_log", TYPE)
        self.priority = priority

        def call(request: Any, timeout: float) -> Any:
            self.asked.append(request)
            return new(f"{TYPE}_Response", accepted=True, file="f.mcap")

        return SimpleNamespace(call=call)

    def serve(self, name: str, srv_type: str, handler: Any) -> None:
        assert (name, srv_type) == ("station/onboard_log", TYPE)
        self.handler: Any = answering(srv_type, handler)


def test_the_station_passes_questions_on_last_of_all_and_not_over_a_lost_link() -> None:
    node, state = FakeNode(), [LinkState.GOOD]
    forward_service(node, "onboard_log", lambda: state[0], 1.0)  # type: ignore[arg-type]
    assert node.priority == "background"
    request = new(f"{TYPE}_Request", requester="anna", columns=["a"])
    assert node.handler(request).file == "f.mcap"
    assert node.asked == [request]
    state[0] = LinkState.LOST
    refused = node.handler(request)
    assert not refused.accepted
    assert "the link to the vehicle is lost" in refused.reason
    assert node.asked == [request]
