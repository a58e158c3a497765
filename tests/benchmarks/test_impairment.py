"""The benchmarks' impaired link impairs packets as set: by its own clock, and in real time."""

from __future__ import annotations

import itertools
import subprocess
import sys

import pytest

from benchmarks.impairment.link import A, B, ImpairedLink
from benchmarks.impairment.wire import Conditions, Wire

PACKET = bytes(1000)


def carried(conditions: Conditions, count: int, period: float, seed: int = 5) -> list[float | None]:
    """Return the delays (s) of packets sent every `period`; None for lost ones."""
    wire = Wire(conditions, seed)
    found: list[float | None] = [None] * count
    for k in range(count):
        wire.offer(k.to_bytes(4, "little") + PACKET[4:], k * period)
        # Look at the wire when a packet arrives.
        while wire.next_arrival <= (k + 1) * period or (k == count - 1 and wire.next_arrival < 1e9):
            at = wire.next_arrival
            for packet in wire.due(at):
                number = int.from_bytes(packet[:4], "little")
                found[number] = at - number * period
    return found


def test_a_plain_wire_carries_all_at_once() -> None:
    assert carried(Conditions(), 100, 0.01) == [0.0] * 100


def test_delay_and_jitter_stay_within_their_bounds_and_keep_the_order() -> None:
    delays = carried(Conditions(delay=0.010, jitter=0.005), 2000, 0.001)
    assert None not in delays
    times = [0.001 * k + d for k, d in enumerate(delays) if d is not None]
    assert times == sorted(times)
    assert min(d for d in delays if d is not None) >= 0.005 - 1e-9
    assert max(d for d in delays if d is not None) <= 0.015 + 1e-9


@pytest.mark.parametrize(("burst", "mean_run"), [(0.0, 1.25), (0.08, 8.5)])
def test_the_share_lost_and_the_length_of_its_runs(burst: float, mean_run: float) -> None:
    delays = carried(Conditions(loss=0.2, burst=burst), 40_000, 0.01)
    lost = [d is None for d in delays]
    assert sum(lost) / len(lost) == pytest.approx(0.2, abs=0.02)
    begins = sum(now and not before for before, now in itertools.pairwise(lost))
    assert sum(lost) / begins == pytest.approx(mean_run, rel=0.15)


def test_a_slow_wire_queues_then_drops() -> None:
    # 1000 B every 1 ms are 8 Mbit/s on a link of 2 Mbit/s: three of four are too many.
    delays = carried(Conditions(rate=2e6, queue=10_000), 4000, 0.001)
    kept = [d for d in delays if d is not None]
    assert len(kept) / len(delays) == pytest.approx(0.25, abs=0.01)
    assert max(kept) == pytest.approx(10_000 * 8 / 2e6, abs=0.005)


def test_an_interruption_loses_what_comes_meanwhile() -> None:
    wire = Wire(Conditions(), 1)
    wire.interrupt(1.0, 0.5)
    for now in (1.0, 1.2, 1.49, 1.5, 1.6):
        wire.offer(PACKET, now)
    assert (wire.lost, len(wire.due(2.0))) == (3, 2)


def test_what_is_no_condition_is_refused() -> None:
    with pytest.raises(ValueError, match=r"loss 1\.5 is no share; allowed 0 to 1"):
        Conditions(loss=1.5)


ECHO = """
import socket
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
    s.bind(("0.0.0.0", 9000))
    print("up", flush=True)
    while True:
        data, address = s.recvfrom(2000)
        s.sendto(data, address)
"""
ASK = """
import socket, sys, time
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
    s.settimeout(0.15)
    back, least = 0, 9.0
    for k in range(int(sys.argv[2])):
        began = time.monotonic()
        s.sendto(b"%d" % k, (sys.argv[1], 9000))
        try:
            while s.recv(2000) != b"%d" % k:
                pass
        except TimeoutError:
            continue
        back, least = back + 1, min(least, time.monotonic() - began)
print(back, least)
"""


@pytest.mark.needs("namespaces")
def test_two_programs_meet_over_a_real_link() -> None:
    with ImpairedLink(seed=3) as link:
        echo = link.run(A, [sys.executable, "-c", ECHO], stdout=subprocess.PIPE)
        assert echo.stdout is not None
        assert echo.stdout.readline() == b"up\n"

        def ask(count: int) -> tuple[int, float]:
            words = [sys.executable, "-c", ASK, A, str(count)]
            out, _ = link.run(B, words, stdout=subprocess.PIPE).communicate(timeout=30)
            back, least = out.split()
            return int(back), float(least)

        assert ask(20)[0] == 20
        link.change(Conditions(delay=0.02))
        assert ask(5)[1] >= 0.04
        from_a, from_b = link.change(Conditions(loss=1.0))
        assert (from_a.lost, from_b.lost) == (0, 0)
        assert from_b.sent >= 25
        assert ask(2)[0] == 0
        assert link.counts()[1].lost == 2
