"""A law that another program answers over UDP."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from control.controller import GeometricController
from tests.support.lab import Lab
from tests.support.law_bench import LawBench
from vehicle.laws.contract import INPUT, INPUT_TYPE, LAW, OUTPUT, OUTPUT_TYPE
from vehicle.laws.external import ExternalLaw
from vehicle.plugins.external import CONSECUTIVE
from vehicle.plugins.links import UdpLink

PEER = Path(__file__).with_name("udp_peer.py")
DOCUMENT = Path(__file__).parents[3] / "docs" / "extending" / "plugins.md"


@pytest.fixture
def peer() -> Iterator[Callable[[int], str]]:
    """Yield a function that starts a program with so many answers and returns its address."""
    started: list[subprocess.Popen[str]] = []

    def start(answers: int) -> str:
        words = [sys.executable, str(PEER), str(answers)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        started.append(process)
        assert process.stdout is not None
        return f"127.0.0.1:{int(process.stdout.readline())}"

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def lab() -> Iterator[Callable[[str], Lab]]:
    """Yield a function that makes a lab which flies the law at an address."""
    labs: list[Lab] = []

    def made(address: str) -> Lab:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("", 0))
            port = free.getsockname()[1]
        settings = {"control.plugin.udp_peer": address, "control.plugin.udp_port": port}
        labs.append(Lab(settings=settings).ready())
        labs[-1].change({"control.law": "udp"})
        return labs[-1]

    yield made
    for one in labs:
        one.stack.law.close()


def test_a_program_of_another_make_flies_the_vehicle(
    peer: Callable[[int], str], lab: Callable[[str], Lab]
) -> None:
    flown = lab(peer(1_000_000)).hovering(settling=1.0)
    external = flown.stack.law.external
    assert external is not None
    assert external.flown
    assert external.missed == 0
    assert flown.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.06)


def test_a_program_that_falls_silent_is_replaced_in_that_tick(
    peer: Callable[[int], str], lab: Callable[[str], Lab]
) -> None:
    flown = lab(peer(1000)).hovering(settling=0.5)
    assert "no answer in time to 1 inputs in a row, 1 of 1001 in all" in flown.said
    assert flown.parameter("control.law") == "geometric"
    assert flown.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.05)


@pytest.mark.parametrize(
    ("packet", "why"),
    [
        (struct.pack("<3d", 0.0, 12.8, 0.0), "a packet of 24 bytes came, expected 40: 5 doubles"),
        # stale: of no input that was sent
        (struct.pack("<5d", 0.0, 12.8, 0.4, 0.4, 0.0), "no answer in time to 1 inputs in a row"),
    ],
)
def test_packets_of_another_length_and_stale_ones_end_the_law_and_are_never_flown(
    packet: bytes, why: str
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("", 0))
            port = free.getsockname()[1]
        link = UdpLink(
            LAW, "control.plugin", f"127.0.0.1:{other.getsockname()[1]}", port, waits=True
        )
        law = ExternalLaw("udp", link, GeometricController(), waits=True)
        bench = LawBench(law)
        other.sendto(packet, ("127.0.0.1", port))
        for _ in range(3):
            bench.ticks(1)
            assert bench.flies_built_in
        assert why in law.failure
        law.close()


def test_what_came_before_the_link_was_connected_is_from_anybody_and_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    packet = struct.pack("<5d", 0.0, 12.8, 0.0, 0.0, 0.0)

    class Early(socket.socket):
        """A socket to which a stranger sends as soon as it is bound."""

        def connect(self, address: Any) -> None:
            with plain(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.sendto(packet, ("127.0.0.1", self.getsockname()[1]))
            assert self.recv(1024, socket.MSG_PEEK) == packet
            super().connect(address)

    plain = socket.socket
    with plain(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        monkeypatch.setattr(socket, "socket", Early)
        peer = f"127.0.0.1:{other.getsockname()[1]}"
        link = UdpLink(LAW, "control.plugin", peer, 0, waits=False)
        assert link.receive() is None
        link.send(b"x")
        own = other.recvfrom(1024)[1]
        other.sendto(packet, own)
        assert link.receive() == packet
        assert link._socket.getsockname() == own, "it listens to this computer alone"
        link.close()


def test_in_real_time_a_silent_law_costs_no_tick_and_is_disengaged_after_25() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        link = UdpLink(LAW, "control.plugin", f"127.0.0.1:{other.getsockname()[1]}", 0, waits=False)
        law = ExternalLaw("udp", link, GeometricController(), waits=False)
        bench = LawBench(law)
        assert law.is_ready
        failures = []
        for _ in range(CONSECUTIVE + 2):
            bench.ticks(1)
            assert bench.flies_built_in
            failures.append(law.failure)
        assert len(other.recv(1024)) == INPUT_TYPE.itemsize
        law.close()
    assert failures[CONSECUTIVE - 1] == ""
    assert f"no answer in time to {CONSECUTIVE} inputs in a row" in failures[CONSECUTIVE]


def test_the_document_lists_every_field_of_the_contract_in_order() -> None:
    section = DOCUMENT.read_text().partition("# An estimator of your own")[0]
    cells = [line.split("|") for line in section.splitlines()]
    rows = [row[1:4] for row in cells if len(row) == 6 and "`" in row[1]]
    listed = [(name.strip(" `"), int(size), unit.strip()) for name, size, unit in rows]
    assert listed == [(f.name, f.size, f.unit) for f in (*INPUT, *OUTPUT)]
    assert (INPUT_TYPE.itemsize, OUTPUT_TYPE.itemsize) == (8 * 39, 8 * 5)
