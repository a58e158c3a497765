"""The shared-memory rings: order, wrap, loss, restart, and two real processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import deque

import numpy as np
import pytest

from quadrotor.checkout import ROOT
from quadrotor.records import TICK, new_tick
from vehicle.processes.rings import HEADER_BYTES, TAIL, ByteRing, RecordRing, create, fence


def numbered(sequence: int) -> np.ndarray:
    tick = new_tick()
    tick["sequence"] = sequence
    tick["state"]["position_w"] = (sequence, -sequence, 0.5)
    tick["status"]["pressure"] = 1e5 + sequence
    return tick


def byte_ring(slots: int = 4, slot_size: int = 36) -> ByteRing:
    return ByteRing(create(slots, slot_size), slots, slot_size)


def tick_ring(slots: int) -> RecordRing:
    return RecordRing(create(slots, TICK.itemsize), TICK, slots)


def test_bytes_come_out_in_the_order_they_went_in() -> None:
    ring = byte_ring()
    messages = [b"", b"a", b"x" * ring.longest]
    assert all(ring.push(m) for m in messages)
    assert len(ring) == 3
    assert ring.pop_all() == messages
    assert ring.pop() is None


def test_a_full_ring_keeps_the_old_and_counts_the_new() -> None:
    ring = byte_ring(slots=2)
    assert [ring.push(b"%d" % k) for k in range(5)] == [True, True, False, False, False]
    assert ring.dropped == 3
    assert ring.pop_all() == [b"0", b"1"]
    assert ring.push(b"again")
    assert ring.pop() == b"again"


def test_records_come_out_one_by_one_and_are_the_consumers_own() -> None:
    ring = tick_ring(slots=3)
    ticks = np.zeros(5, TICK)
    ticks["sequence"] = np.arange(5)
    assert [ring.push(ticks[k : k + 1]) for k in range(4)] == [True, True, True, False]
    first = ring.pop()
    assert first is not None
    assert first.tobytes() == ticks[:1].tobytes()
    first["sequence"] = 9  # its memory is not the ring's
    assert ring.push(ticks[4:])
    taken = [ring.pop() for _ in range(4)]
    assert [int(one["sequence"][0]) for one in taken[:3] if one is not None] == [1, 2, 4]
    assert taken[3] is None


def test_a_message_longer_than_a_slot_is_dropped_whole() -> None:
    ring = byte_ring()
    assert not ring.push(b"x" * (ring.longest + 1))
    assert ring.dropped == 1
    assert len(ring) == 0
    assert ring.push(b"y")
    assert ring.pop() == b"y"


def test_random_traffic_equals_a_bounded_queue() -> None:
    seed = 20_260_701
    print("seed", seed)
    random = np.random.default_rng(seed)
    ring, model, dropped = byte_ring(slots=5), deque[bytes](), 0
    for k in range(4000):
        if random.random() < 0.55:
            message = random.bytes(int(random.integers(0, ring.longest + 1)))
            if len(model) < 5:
                model.append(message)
                assert ring.push(message), k
            else:
                dropped += 1
                assert not ring.push(message), k
        else:
            assert ring.pop() == (model.popleft() if model else None), k
    assert ring.dropped == dropped > 0


@pytest.mark.parametrize("slots", [1, 3, 8])
def test_records_survive_the_wrap_bit_for_bit(slots: int) -> None:
    ring, sequence = tick_ring(slots), 0
    for batch in (1, slots, slots - 1, slots, 1):
        sent = [numbered(sequence + k) for k in range(batch)]
        sequence += batch
        assert all(ring.push(tick) for tick in sent)
        received = ring.pop_all()
        assert received.tobytes() == b"".join(tick.tobytes() for tick in sent)
    assert ring.pop_all().shape == (0,)
    assert ring.dropped == 0
    assert ring.pushed == sequence


def test_records_are_dropped_newest_first_when_the_reader_is_away() -> None:
    ring = tick_ring(3)
    assert [ring.push(numbered(k)) for k in range(5)] == [True] * 3 + [False] * 2
    assert ring.pop_all()["sequence"].tolist() == [0, 1, 2]
    assert ring.dropped == 2


def test_popped_records_do_not_change_when_the_slot_is_used_again() -> None:
    ring = tick_ring(1)
    ring.push(numbered(1))
    kept = ring.pop_all()
    ring.push(numbered(2))
    assert kept["sequence"].tolist() == [1]


def test_counters_go_on_beyond_32_bits() -> None:
    ring = byte_ring(slots=4)
    start = (1 << 40) + 3
    ring._words[0] = ring._words[TAIL] = start
    for k in range(9):
        assert ring.push(b"%d" % k)
        assert ring.pop() == b"%d" % k
    assert ring.pushed == start + 9


def test_a_reader_opened_again_goes_on_where_the_last_one_stopped() -> None:
    ring = byte_ring(slots=4)
    for k in range(3):
        ring.push(b"%d" % k)
    assert ring.pop() == b"0"
    again = ByteRing(ring.fd, 4, 36)
    assert again.pop_all() == [b"1", b"2"]


def test_two_ends_with_different_sizes_are_refused() -> None:
    fd = create(4, 36)
    with pytest.raises(ValueError, match="both ends must be made with the same sizes"):
        ByteRing(fd, 8, 36)
    os.close(fd)


def test_the_fence_of_weakly_ordered_processors_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vehicle.processes.rings._TOTAL_STORE_ORDER", False)
    fence()
    ring = byte_ring()
    assert ring.push(b"a")
    assert ring.pop() == b"a"


WRITER = """
import sys
from quadrotor.records import TICK, new_tick
from vehicle.processes.rings import RecordRing
ring = RecordRing(int(sys.argv[1]), TICK, int(sys.argv[2]))
tick, count = new_tick(), int(sys.argv[3])
for sequence in range(count):
    tick["sequence"] = sequence
    tick["imu"]["stamp_ns"] = 3 * sequence
    tick["status"]["pressure"] = float(sequence)
    ring.push(tick)
print(ring.dropped)
"""


def test_no_record_is_torn_or_swapped_between_two_processes() -> None:
    slots, count = 64, 20_000
    fd = create(slots, TICK.itemsize)
    ring = RecordRing(fd, TICK, slots)
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(fd), str(slots), str(count)],
        pass_fds=[fd],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    seen: list[np.ndarray] = []
    while writer.poll() is None or len(ring):
        ticks = ring.pop_all()
        if len(ticks):
            seen.append(ticks)
    assert writer.stdout is not None
    assert int(writer.stdout.read()) == ring.dropped
    sequences = np.concatenate([t["sequence"] for t in seen]).astype(np.int64)
    stamps = np.concatenate([t["imu"]["stamp_ns"] for t in seen])
    pressures = np.concatenate([t["status"]["pressure"] for t in seen])
    assert len(sequences) + ring.dropped == count
    assert (np.diff(sequences) > 0).all()
    assert (stamps == 3 * sequences).all()
    assert (pressures == sequences).all()
    assert ring._memory.size() == HEADER_BYTES + slots * TICK.itemsize


def numbers(records: np.ndarray) -> list[int]:
    return [int(number) for number in records["sequence"]]


def test_what_was_read_and_not_freed_is_there_for_the_next_consumer() -> None:
    fd = create(4, TICK.itemsize)
    ring = RecordRing(fd, TICK, 4)
    for k in range(3):
        ring.push(numbered(k))
    assert numbers(ring.read_before()) == []
    assert not ring.was_read
    assert numbers(ring.read()) == [0, 1, 2]
    assert numbers(ring.read()) == []
    ring.free(1)
    ring.push(numbered(3))
    again = RecordRing(fd, TICK, 4)  # the consumer has died
    assert again.was_read
    assert numbers(again.read_before()) == [1, 2]
    assert numbers(again.read()) == [3], "each is read once"
    again.free(3)
    assert len(again) == 0
    assert [again.push(numbered(k)) for k in range(4, 9)] == [True] * 4 + [False]
    assert numbers(again.read()) == [4, 5, 6, 7]


def test_what_is_read_keeps_its_slot_until_it_is_freed_or_room_is_made_ahead() -> None:
    ring = tick_ring(4)
    for k in range(4):
        ring.push(numbered(k))
    ring.read()
    assert not ring.push(numbered(9))
    ring.free_ahead(3)
    assert [ring.push(numbered(k)) for k in (4, 5, 6)] == [True] * 3
    ring.free(2)  # of those freed already
    assert not ring.push(numbered(9))
    ring.free(2)
    assert len(ring) == 3, "those not read"
    assert numbers(ring.read()) == [4, 5, 6]
    ring.free(3)
    assert len(ring) == 0


def test_a_ring_that_was_popped_can_be_read_on() -> None:
    ring = tick_ring(4)
    ring.push(numbered(0))
    ring.pop_all()
    assert numbers(ring.read_before()) == []
    ring.push(numbered(1))
    assert numbers(ring.read()) == [1]
