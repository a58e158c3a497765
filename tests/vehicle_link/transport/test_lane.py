"""Lane: what its datagrams let through, and its two ends over real sockets on loopback."""

from __future__ import annotations

import itertools
import os
import queue
import random
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pytest

from quadrotor.errors import LinkError
from vehicle_link import clock
from vehicle_link.lane import replay_window, vehicle_lane
from vehicle_link.lane.datagram import (
    A_HELLO,
    HELLO,
    LARGEST,
    LARGEST_PAYLOAD,
    TO_STATION,
    TO_VEHICLE,
    Opener,
    Refused,
    Sealer,
    key_id_of,
)
from vehicle_link.lane.replay_window import SIZE, NewestOnly, ReplayWindow
from vehicle_link.lane.station_lane import StationLane
from vehicle_link.lane.vehicle_lane import VehicleLane
from vehicle_link.lockstep import Page
from vehicle_link.messages import decode, encode
from vehicle_link.transport.publisher import Received

WAIT = 10.0  # s: a bound, not an expectation
KEY, KEY_ID = bytes(range(32)), 7
RESPONSE: Final = "quadlab_msgs/srv/Lane_Response"


def message(sequence: int = 5, payload: bytes = b"a payload") -> Received:
    return Received(payload, sequence, -12_345, 0, bytes(range(16)))


def opener(topics: tuple[str, ...] = TO_STATION) -> tuple[Opener, Refused]:
    refused = Refused()
    return Opener(KEY, topics, refused), refused


def said(opened: tuple[str, Received] | None) -> tuple[str, int, int, bytes, bytes]:
    assert opened is not None
    topic, received = opened
    return topic, received.sequence, received.source_ns, received.gid, received.payload


# --------------------------------------------------------------------- one datagram
@pytest.mark.parametrize("size", [0, 1, 1048, LARGEST_PAYLOAD])
def test_what_is_sealed_opens_to_the_same_and_fits_every_network(size: int) -> None:
    payload = os.urandom(size)
    datagram = Sealer(KEY_ID, KEY).seal("telemetry", message(payload=payload))
    assert len(datagram) <= LARGEST
    assert key_id_of(datagram) == KEY_ID
    assert said(opener()[0].open(datagram)) == ("telemetry", 5, -12_345, bytes(range(16)), payload)
    assert size < 9 or payload not in datagram


def test_one_changed_bit_anywhere_is_refused_and_leaves_the_true_one_welcome() -> None:
    datagram = Sealer(KEY_ID, KEY).seal("telemetry", message())
    taker, refused = opener()
    for place, bit in itertools.product(range(len(datagram)), range(8)):
        changed = bytearray(datagram)
        changed[place] ^= 1 << bit
        if key_id_of(bytes(changed)) == KEY_ID:
            assert taker.open(bytes(changed)) is None, (place, bit)
    header = 5  # version and id of the keys: not for this opener
    assert refused.total == 8 * (len(datagram) - header)
    assert taker.open(datagram) is not None


def test_a_datagram_is_taken_once_whatever_its_order() -> None:
    sealer, (taker, refused) = Sealer(KEY_ID, KEY), opener()
    datagrams = [sealer.seal("telemetry", message(k)) for k in range(200)]
    shuffled = random.Random("lane").sample(datagrams, len(datagrams))
    assert sorted(said(taker.open(one))[1] for one in shuffled) == list(range(200))
    assert [taker.open(one) for one in shuffled] == [None] * 200
    assert refused.replayed == 200


def test_the_window_agrees_with_a_set_of_all_that_came() -> None:
    drawn, window, came = random.Random("window"), ReplayWindow(), set[int]()
    newest = 0
    for _ in range(5000):
        counter = max(0, newest + drawn.choice((1, 1, 1, 2, 50, -1, -2, -30, -SIZE, -SIZE + 1)))
        expected = counter > 0 and counter not in came and counter > newest - SIZE
        assert window.is_new(counter) == expected, (counter, newest)
        if expected:
            window.mark_received(counter)
            came.add(counter)
            newest = max(newest, counter)
    window.mark_received(2**64 - 1)
    assert not window.is_new(newest)


def test_topics_for_the_other_end_are_refused() -> None:
    taker, refused = opener(TO_STATION)
    assert taker.open(Sealer(KEY_ID, KEY).seal("joy", message())) is None
    assert refused.unexpected == 1


def test_no_counter_is_used_twice_by_several_threads() -> None:
    sealer, sealed = Sealer(KEY_ID, KEY), list[bytes]()
    threads = [
        threading.Thread(
            target=lambda: sealed.extend(sealer.seal("joy", message()) for _ in range(300))
        )
        for _ in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT)
    assert len({datagram[:13] for datagram in sealed}) == len(sealed) == 1800


def test_bytes_of_any_length_are_no_datagram_and_no_error() -> None:
    drawn, (taker, refused) = random.Random("garbage"), opener()
    for size in (*range(80), LARGEST, LARGEST + 1):
        for _ in range(20):
            garbage = drawn.randbytes(size)
            if key_id_of(garbage) is not None:
                assert taker.open(garbage) is None
    whole = Sealer(KEY_ID, KEY).seal("telemetry", message(payload=bytes(LARGEST_PAYLOAD + 1)))
    assert len(whole) == LARGEST + 1
    assert key_id_of(whole) is None
    assert refused.replayed + refused.forged == refused.total


def test_an_order_is_not_undone_by_an_older_one_that_comes_later() -> None:
    newest, sent = NewestOnly(), [message(k) for k in (1, 2, 5)]
    assert all(newest.is_newer("joy", one) for one in sent)
    assert not any(newest.is_newer("joy", message(k)) for k in (5, 4, 1))
    assert newest.late == 3
    assert newest.is_newer("joy", message(6))
    assert newest.is_newer("tracker_pose", message(1))
    assert newest.is_newer("joy", Received(b"", 1, 0, 0, b"another's"))
    for k in range(100):
        assert newest.is_newer("joy", Received(b"", 1, 0, 0, b"%d" % k))
    assert len(newest._newest["joy"]) == replay_window.KEPT


# --------------------------------------------------------------------- two ends
class Wire:
    """UDP port that leads to another, may be cut, and may seem to have moved."""

    def __init__(self, port: int) -> None:
        self.near = self._new()
        self.port: int = self.near.getsockname()[1]
        self.far = self._new()
        self.leads_to, self.cut = port, False
        self.carried: list[bytes] = []
        self._station: tuple[str, int] | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def move(self) -> None:
        """Send from another address from now on."""
        self.far = self._new()

    def close(self) -> None:
        self._closing.set()
        self._thread.join(WAIT)

    def _new(self) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", 0))
        return made

    def _run(self) -> None:
        while not self._closing.is_set():
            for one in select.select([self.near, self.far], [], [], 0.02)[0]:
                data, source = one.recvfrom(2000)
                if self.cut:
                    continue
                if one is self.near:
                    self._station = source
                    self.carried.append(data)
                    self.far.sendto(data, ("127.0.0.1", self.leads_to))
                elif self._station is not None:
                    self.near.sendto(data, self._station)
        self.near.close()
        self.far.close()


class Inbox:
    def __init__(self) -> None:
        self.got: queue.SimpleQueue[tuple[str, Received]] = queue.SimpleQueue()

    def __call__(self, topic: str, received: Received) -> None:
        self.got.put((topic, received))

    def next(self) -> tuple[str, int, bytes]:
        topic, received = self.got.get(timeout=WAIT)
        return topic, received.sequence, received.payload


class Ends:
    """A vehicle, and stations that reach it by a wire each."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self.at_vehicle = Inbox()
        self.asked = 0
        self.answer_is_lost = False
        self.start_vehicle(1)

    def start_vehicle(self, instance: int) -> None:
        self.instance = instance
        self.vehicle = VehicleLane(0, self.at_vehicle, "127.0.0.1")
        self._stack.callback(self.vehicle.close)

    def ask(self, station: int, wire: Callable[[int], int]) -> Any:
        """Call as over the link: bytes there and back."""
        self.asked += 1
        answer = decode(encode(self.vehicle.grant(station)), RESPONSE)
        if self.answer_is_lost:
            raise LinkError("no answer")
        answer.port = wire(answer.port)
        return answer

    def station(self, instance: int = 99) -> tuple[StationLane, Wire, Inbox]:
        inbox, wire = Inbox(), Wire(self.vehicle.port)
        self._stack.callback(wire.close)

        def through(port: int) -> int:
            wire.leads_to = port
            return wire.port

        lane = StationLane("127.0.0.1", lambda: self.ask(instance, through), inbox)
        self._stack.callback(lane.close)
        self.until(lambda: self.vehicle.stations > 0 and lane._keys is not None, lane)
        return lane, wire, inbox

    def until(self, reached: Callable[[], bool], *lanes: StationLane) -> None:
        """Wait while the vehicle sends heartbeats, over the link and by the lane."""
        tick, end = threading.Event(), time.monotonic() + WAIT
        while not reached():
            assert time.monotonic() < end
            for lane in lanes:
                lane.note_vehicle(self.instance)
            tick.wait(0.01)

    def heard_by(self, inbox: Inbox, payload: bytes) -> None:
        """Let the vehicle send until the payload has arrived."""
        got: list[tuple[str, int, bytes]] = []

        def came() -> bool:
            self.vehicle.send("telemetry", message(payload=payload))
            while not inbox.got.empty():
                got.append(inbox.next())
            return ("telemetry", 5, payload) in got

        self.until(came)


@pytest.fixture
def ends() -> Iterator[Ends]:
    with ExitStack() as stack:
        yield Ends(stack)


def test_a_lane_carries_both_ways(ends: Ends) -> None:
    lane, wire, inbox = ends.station()
    ends.vehicle.send("telemetry", message(1, b"there"))
    assert inbox.next() == ("telemetry", 1, b"there")
    assert lane.is_up
    assert lane.send("tracker_pose", message(2, b"here"))
    assert ends.at_vehicle.next() == ("tracker_pose", 2, b"here")
    assert not lane.send("bearings", message(payload=bytes(LARGEST_PAYLOAD + 1)))
    assert all(b"here" not in datagram for datagram in wire.carried)
    assert ends.asked == 1


def test_who_greets_otherwise_says_no_hello(ends: Ends) -> None:
    lane, wire, _ = ends.station()
    pause = threading.Event()

    def beats_alone() -> bool:
        """Send only heartbeats for some 0.4 s.

        A machine that stalls in the meantime lets a hello in between.
        """
        before = len(wire.carried)
        for count in range(12):
            lane.send("station_heartbeat", message(count + 1, b"a beat"), greets=True)
            assert ends.at_vehicle.next()[2] == b"a beat"
            pause.wait(0.03)
        return len(wire.carried) == before + 12

    ends.until(beats_alone)
    silent = len(wire.carried)
    ends.until(lambda: len(wire.carried) > silent)  # now it does


def test_the_vehicle_answers_nobody_without_keys(ends: Ends) -> None:
    lane, wire, _ = ends.station()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        before = ends.vehicle.refused.total
        forged = bytearray(Sealer(lane._keys.key_id, KEY).seal(HELLO, A_HELLO))  # type: ignore[union-attr]
        forged[5:13] = (2**40).to_bytes(8, "little")
        for garbage in (b"", b"x", os.urandom(60), bytes(1500), bytes(forged), *wire.carried[:1]):
            stranger.sendto(garbage, ("127.0.0.1", ends.vehicle.port))
        ends.until(lambda: ends.vehicle.refused.total == before + 6)
        assert ends.vehicle.refused == Refused(foreign=4, forged=1, replayed=1)
        lane.send("joy", message(1))  # behind them in the same socket
        assert ends.at_vehicle.next()[0] == "joy"
        ends.vehicle.send("telemetry", message())
        assert not select.select([stranger], [], [], 0.0)[0]


def test_the_station_drops_what_is_not_of_its_vehicle(ends: Ends) -> None:
    lane, wire, inbox = ends.station()
    assert lane._socket is not None
    own = wire.carried[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for garbage in (b"", bytes(1500), own, os.urandom(100)):
            stranger.sendto(garbage, ("127.0.0.1", lane._socket.port))
        ends.until(lambda: lane.refused.total == 4)
        assert lane.refused == Refused(foreign=3, forged=1)  # its own, sent back to it
    ends.heard_by(inbox, b"still")


def test_data_follow_a_station_to_its_new_address(ends: Ends) -> None:
    _, wire, inbox = ends.station()
    ends.heard_by(inbox, b"before")
    wire.move()
    ends.heard_by(inbox, b"after")
    assert ends.asked == 1


def test_a_break_needs_no_new_keys(ends: Ends) -> None:
    lane, wire, inbox = ends.station()
    ends.heard_by(inbox, b"before")
    wire.cut = True
    ends.until(lambda: not lane.is_up)  # the link is down as well: no one can be asked
    wire.cut = False
    ends.heard_by(inbox, b"after")
    assert lane.is_up
    assert ends.asked == 1


def test_a_vehicle_started_again_gives_new_keys(ends: Ends) -> None:
    lane, _, inbox = ends.station()
    ends.heard_by(inbox, b"before")
    ends.vehicle.close()
    ends.start_vehicle(2)
    ends.until(lambda: ends.vehicle.stations == 1, lane)
    ends.heard_by(inbox, b"after")
    assert ends.asked == 2


def test_keys_in_use_stay_good_until_new_ones_are_used(ends: Ends) -> None:
    lane, _, inbox = ends.station(instance=5)
    ends.answer_is_lost, ends.instance = True, 2
    ends.until(lambda: ends.asked >= 3, lane)
    ends.heard_by(inbox, b"by the old keys")
    ends.answer_is_lost = False
    ends.until(lambda: lane._keys is not None and lane._keys.vehicle == 2, lane)
    ends.until(lambda: len(ends.vehicle._lanes) == 1, lane)
    ends.heard_by(inbox, b"by the new keys")


def test_two_stations_have_a_lane_each(ends: Ends) -> None:
    (one, _, at_one), (two, _, at_two) = ends.station(1), ends.station(2)
    ends.until(lambda: ends.vehicle.stations == 2)
    ends.vehicle.send("telemetry", message(1, b"to both"))
    assert at_one.next() == at_two.next() == ("telemetry", 1, b"to both")
    assert one._keys is not None
    assert two._keys is not None
    assert one._keys.key_id != two._keys.key_id
    for lane, number in ((one, 1), (two, 2)):
        lane.send("joy", message(number))
    assert {ends.at_vehicle.next()[1] for _ in range(2)} == {1, 2}


def test_every_answer_has_keys_of_its_own_and_the_ninth_station_a_place(ends: Ends) -> None:
    answers = [ends.vehicle.grant(k // 2 + 1) for k in range(2 * vehicle_lane.MAX_STATIONS + 4)]
    keys = [bytes(key) for a in answers for key in (a.key_to_station, a.key_to_vehicle)]
    assert len(set(keys)) == len(keys)
    assert len({answer.key_id for answer in answers}) == len(answers)
    lanes = list(ends.vehicle._lanes.values())
    assert [lane.instance for lane in lanes] == list(range(3, vehicle_lane.MAX_STATIONS + 3))
    assert "key" not in repr(lanes[0]).replace("key_id", "")


def test_who_only_hears_takes_no_place_of_who_may_send(ends: Ends) -> None:
    """Neither the pilot's own number, which heartbeats carry, nor many listeners take it."""
    _, _, inbox = ends.station(1)
    for k in range(2 * vehicle_lane.MAX_STATIONS):
        answer = ends.vehicle.grant(1 + k, (HELLO,))
        sealer = Sealer(answer.key_id, bytes(answer.key_to_vehicle))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as looker:
            looker.sendto(sealer.seal(HELLO, A_HELLO), ("127.0.0.1", ends.vehicle.port))
            key_id = int(answer.key_id)
            ends.until(lambda key_id=key_id: ends.vehicle._lanes[key_id].address)  # type: ignore[misc]
    ends.heard_by(inbox, b"still")
    assert ends.asked == 1
    assert ends.vehicle.stations == vehicle_lane.MAX_STATIONS


def test_a_taken_port_gives_another(ends: Ends) -> None:
    other = VehicleLane(ends.vehicle.port, ends.at_vehicle, "127.0.0.1")
    assert other.port != ends.vehicle.port
    assert other.grant(1).port == other.port
    other.close()


def test_what_stations_may_send_is_the_vehicles_choice(ends: Ends) -> None:
    answer = ends.vehicle.grant(3, (HELLO,))
    sealer = Sealer(answer.key_id, bytes(answer.key_to_vehicle))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as looker:
        for topic in (HELLO, *TO_VEHICLE[1:]):
            looker.sendto(sealer.seal(topic, message()), ("127.0.0.1", ends.vehicle.port))
        ends.until(lambda: ends.vehicle.refused.unexpected == len(TO_VEHICLE) - 1)
        assert ends.at_vehicle.got.empty()
        ends.vehicle.send("telemetry", message())
        assert looker.recv(2000)


def test_a_station_is_not_given_up_while_simulated_time_stands_still(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process that reads the datagrams may have no processor for longer."""
    page = Page(["quad1"], tmp_path)
    clock.follow(page.path)
    vehicle = VehicleLane(0, lambda topic, received: None, "127.0.0.1")
    try:
        granted = vehicle.grant(5)
        hello = Sealer(int(granted.key_id), bytes(granted.key_to_vehicle)).seal(HELLO, A_HELLO)
        vehicle._handle(hello, ("127.0.0.1", 9))
        words = clock.page()
        assert words is not None
        words[clock.LIMIT] = clock.monotonic_ns()
        later_ns = time.monotonic_ns() + vehicle_lane.PATIENCE_NS + 1_000_000_000
        monkeypatch.setattr(time, "monotonic_ns", lambda: later_ns)
        assert vehicle.send("telemetry", message())
    finally:
        vehicle.close()
        clock.follow(None)
        page.close()
