"""Clock offset, heartbeats and repeated requests, without a network."""

from __future__ import annotations

import threading
from typing import Final

import numpy as np
import pytest

from quadrotor.errors import RefusedError
from tests.support.narrowing import now
from vehicle_link.messages import new
from vehicle_link.messages.records import CommandRequest, CommandResponse
from vehicle_link.transport.heartbeat import HeartbeatMonitor, LinkState
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.time_sync import ClockOffset, Exchange

MS = 1_000_000
REQUEST: Final = "quadlab_msgs/srv/Command_Request"
RESPONSE: Final = "quadlab_msgs/srv/Command_Response"


def _exchange(at: int, offset: int, there: int, back: int) -> Exchange:
    """Return one exchange started at client time `at`; the server takes 0.1 ms to answer."""
    received = at + there + offset
    sent = received + MS // 10
    return Exchange(at, received, sent, sent - offset + back)


def test_equal_ways_give_the_offset_exactly() -> None:
    one = _exchange(7 * MS, -123_456_789, 2 * MS, 2 * MS)
    assert one.offset_ns == -123_456_789
    assert one.round_trip_ns == 4 * MS


def test_offset_is_wrong_by_at_most_half_the_round_trip() -> None:
    one = _exchange(0, 10**18, 9 * MS, MS)
    assert abs(one.offset_ns - 10**18) <= one.round_trip_ns // 2


def test_the_smallest_round_trip_of_the_window_decides() -> None:
    seed = 5
    print("seed", seed)
    rng = np.random.default_rng(seed)
    clock = ClockOffset(window=10)
    for i in range(30):
        there, back = (int(MS + v) for v in rng.exponential(8 * MS, 2))
        clock.add(_exchange(i * 1000 * MS, 55 * MS, there, back))
    clock.add(_exchange(31_000 * MS, 55 * MS, MS, MS + 2000))
    assert clock.offset_ns == pytest.approx(55 * MS, abs=1000)
    assert clock.round_trip_ns == 2 * MS + 2000
    assert clock.to_client(clock.to_server(123)) == 123


def test_old_exchanges_leave_the_window() -> None:
    clock = ClockOffset(window=2)
    clock.add(_exchange(0, 0, MS, MS))
    for i in (1, 2):
        clock.add(_exchange(i * 1000 * MS, 0, 5 * MS, 3 * MS))
    assert clock.offset_ns == MS  # the first, with 0, is dropped


def test_a_server_that_restarted_is_believed_at_once() -> None:
    clock = ClockOffset()
    assert not clock.known
    clock.add(_exchange(0, 10**18, MS, MS))
    clock.add(_exchange(1000 * MS, 0, 20 * MS, 20 * MS))
    assert now(clock).known
    assert clock.offset_ns == 0


def test_link_is_lost_until_the_first_heartbeat() -> None:
    monitor = HeartbeatMonitor()
    assert monitor.state(10**18) is LinkState.LOST
    assert monitor.age(10**18) == float("inf")
    monitor.note_received(10**18)
    assert monitor.state(10**18) is LinkState.GOOD


@pytest.mark.parametrize(
    ("silence_ms", "state"),
    [(50, "good"), (199, "good"), (200, "degraded"), (999, "degraded"), (1000, "lost")],
)
def test_link_state_follows_the_silence(silence_ms: int, state: str) -> None:
    monitor = HeartbeatMonitor()
    monitor.note_received(0)
    assert monitor.state(silence_ms * MS) == state
    monitor.note_received(silence_ms * MS)
    assert monitor.state(silence_ms * MS) is LinkState.GOOD


def test_a_late_heartbeat_does_not_turn_the_time_back() -> None:
    monitor = HeartbeatMonitor()
    monitor.note_received(500 * MS)
    monitor.note_received(100 * MS)
    assert monitor.age(600 * MS) == pytest.approx(0.1)


class _Counter:
    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, request: CommandRequest) -> CommandResponse:
        self.calls += 1
        if request.requester == "nobody":
            raise RefusedError("nobody may")
        return new(RESPONSE, reason=str(self.calls))


def _request(request_id: str, requester: str = "anna") -> CommandRequest:
    return new(REQUEST, request_id=request_id, requester=requester)


def test_the_same_id_gets_the_same_answer_for_five_seconds() -> None:
    now = 100.0
    counter = _Counter()
    handler = Idempotent(counter, clock=lambda: now)
    assert handler(_request("a")).reason == "1"
    now = 104.9
    assert handler(_request("a")).reason == "1"
    assert handler(_request("b")).reason == "2"
    now = 105.0
    assert handler(_request("a")).reason == "3"


def test_an_empty_id_is_always_handled() -> None:
    counter = _Counter()
    handler = Idempotent(counter)
    handler(_request(""))
    handler(_request(""))
    assert counter.calls == 2


def test_a_refusal_is_repeated_too() -> None:
    counter = _Counter()
    handler = Idempotent(counter)
    for _ in range(2):
        with pytest.raises(RefusedError, match="nobody may"):
            handler(_request("a", "nobody"))
    assert counter.calls == 1


def test_the_same_id_waits_for_the_answer_under_way() -> None:
    entered, proceed = threading.Event(), threading.Event()
    answers: list[str] = []

    def slow(request: CommandRequest) -> CommandResponse:
        entered.set()
        assert proceed.wait(10)
        return new(RESPONSE, reason=f"{request.requester} first")

    handler = Idempotent(slow)

    def call(requester: str) -> None:
        answers.append(handler(_request("a", requester)).reason)

    threads = [threading.Thread(target=call, args=(name,)) for name in ("anna", "bert")]
    threads[0].start()
    assert entered.wait(10)
    threads[1].start()
    proceed.set()
    for thread in threads:
        thread.join(10)
    assert answers == ["anna first", "anna first"]
