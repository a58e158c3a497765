"""Hostile bytes at every socket of a running laboratory whose vehicle hovers.

    python -m benchmarks hostile_doors [--quick | --smoke] [--seed N]

One door after the other gets its bytes from a process of its own, while this one measures how fast
the page answers a request, and a ping on its websocket. Doors for a page's sockets and routes are
attacked as nobody, as a viewer, and as a page of another origin with an admin's cookie.
`hostile_bytes` attacks the parsers themselves.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import httpx
from websockets.sync.client import ClientConnection

from benchmarks.harness import Report, Row, Size, Target, free_port
from benchmarks.link import hostile_bytes
from benchmarks.safety import attackers
from benchmarks.safety.attackers import Attack, Mark
from benchmarks.safety.flight_logs import MOVED, moved, newest_truth
from benchmarks.safety.laboratory import Laboratory
from benchmarks.safety.page_latency import Latency, cookie_of, page_socket, quiet_latency
from benchmarks.safety.starving import command_line, family
from extensions.foxglove.protocol import SUBPROTOCOLS
from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError
from web.live.topic_logs import KEPT

BYTES = 1_000_000, 100_000, 5_000
SETTLED = 2.0  # s
FOREIGN = "http://evil.example"
MEMORY = 100.0
"""Largest growth of all processes, in MB, by all attacks."""
ANSWER = 50.0
"""Longest time, in ms, of half of the page's answers under attack."""


@dataclass
class Held:
    """The state of the laboratory during an attack; times in s, memory in MB."""

    obeyed: int
    latency: Latency
    memory: float
    people: int
    is_hovering: bool
    took: float


def doors(lab: Laboratory, udp: int, tcp: int, count: int) -> dict[str, tuple[Attack, Mark]]:
    """Return all doors with what is sent to them."""
    admin, viewer = cookie_of(lab.browser), cookie_of(signed_in(lab, "viewer"))
    parsers = {door.name: door.valid for door in hostile_bytes.doors()}
    told = parsers["MAVLink over TCP, not signed"]
    sealed = [*parsers["telemetry of the lane"], b"\xc3\0\0\0\1" + bytes(1200)]
    head = b"POST /api/commands/arm HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 2\r\n\r\n{}"
    port, paths, sockets = lab.port, routes(lab), page_sockets(lab)
    harmless = [path for path in paths if not any(one in path for one in attackers.OF_VIEWERS)]
    found: dict[str, tuple[Attack, Mark]] = {
        "page: bytes": (attackers.bytes_on_connections, Mark(port, count, words=[head])),
        "page: slow connections": (attackers.slowly, Mark(port, count)),
        "page: routes, nobody": (attackers.requests, Mark(port, count, words=paths)),
        "page: routes, a viewer": (
            attackers.requests,
            Mark(port, count, cookie=viewer, origin=lab.base, words=harmless),
        ),
        "page: routes, a foreign page of an admin": (
            attackers.requests,
            Mark(port, count, cookie=admin, origin=FOREIGN, words=paths),
        ),
        "page: sockets, a foreign page of an admin": (
            attackers.frames,
            Mark(port, count, cookie=admin, origin=FOREIGN, words=sockets),
        ),
    }
    for one in sockets:
        mark = Mark(port, count, cookie=viewer, origin=lab.base, words=[one])
        found[f"page: {one[0].partition('?')[0]}, a viewer"] = attackers.frames, mark
    hello = attackers.greeting() or [head]
    found["MAVLink, TCP"] = attackers.bytes_on_connections, Mark(tcp, count, words=[*told, head])
    found["MAVLink, UDP"] = attackers.datagrams, Mark(udp, count, words=told)
    for name, number, is_stream in listening(lab):
        if number == port:
            continue
        attack: Attack = attackers.bytes_on_connections if is_stream else attackers.datagrams
        words = [*hello, head] if is_stream else sealed
        kind = "TCP" if is_stream else "UDP"
        alike = sum(one.startswith(f"{name}: {kind}") for one in found)
        found[f"{name}: {kind}{f' {alike + 1}' if alike else ''}"] = (
            attack,
            Mark(number, count, words=words),
        )
    return found


def signed_in(lab: Laboratory, role: str) -> httpx.Client:
    """Return a client that is signed in by an invitation."""
    made = lab.browser.post("/api/invitations", json={"role": role})
    made.raise_for_status()
    client = lab.client()
    token = str(made.json()["url"]).partition("token=")[2]
    client.post("/login", data={"token": token}).raise_for_status()
    return client


def routes(lab: Laboratory) -> list[str]:
    """Return `METHOD /path` of all routes."""
    listed: dict[str, Any] = lab.get("/api/openapi.json")["paths"]
    return [
        f"{method.upper()} {path.replace('{', '').replace('}', '')}"
        for path, methods in listed.items()
        for method in methods
    ] + ["POST /emergency", "POST /login"]


def page_sockets(lab: Laboratory) -> list[tuple[str, str]]:
    """Return the paths of the page's sockets, with the subprotocol that each needs."""
    import viser

    plain = ("/ws/telemetry", "/ws/events", "/ws/stick", "/ws/fleet", "/comparison", "/camera")
    return [
        *((path, "") for path in (*plain, "/ws/picture/front")),
        ("/viser?view=x", f"viser-v{viser.__version__}"),
        ("/foxglove", SUBPROTOCOLS[0]),
    ]


def listening(lab: Laboratory) -> Iterator[tuple[str, int, bool]]:
    """Yield process, port and whether it is TCP, of each socket on which the laboratory listens."""
    for pid in sorted(family(lab.up.pid)):
        name = command_line(pid).partition("-m ")[2].partition(" {")[0].partition(" --")[0]
        links = [link for link in Path(f"/proc/{pid}/fd").iterdir() if link.is_symlink()]
        held = {str(link.readlink()) for link in links if link.is_symlink()}
        for kind, state in (("tcp", "0A"), ("udp", "07")):
            for line in Path(f"/proc/{pid}/net/{kind}").read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == state and f"socket:[{fields[9]}]" in held:
                    yield name, int(fields[1].rpartition(":")[2], 16), kind == "tcp"


def memory(lab: Laboratory) -> float:
    """Return what all processes hold in memory, in MB; pages that they share count for each."""
    pages = 0
    for pid in family(lab.up.pid):
        try:
            pages += int(Path(f"/proc/{pid}/statm").read_text().split()[1])
        except OSError:
            continue
    return pages * 4096 / 1e6


def hold(lab: Laboratory, socket: ClientConnection, work: Future[int], before: float) -> Held:
    """Look at the laboratory while a door is attacked; `before`: the memory in MB."""
    began, latency = time.monotonic(), Latency()
    latency.measure(lab, socket)
    while not work.done():
        latency.measure(lab, socket)
    obeyed = work.result()
    took = time.monotonic() - began
    lab.until("a status", lab.status)
    return Held(obeyed, latency, memory(lab) - before, people(lab), is_hovering(lab), took)


def keep_all(lab: Laboratory, seconds: float) -> None:
    """Let the page load what its routes need, and keep as many samples as it ever does."""
    for path in routes(lab):
        if path.startswith("GET "):
            lab.get(path.partition(" ")[2])
    time.sleep(seconds)


def people(lab: Laboratory) -> int:
    """Return the number of people who are signed in."""
    return len(lab.get("/api/setup/people"))


def is_hovering(lab: Laboratory) -> bool:
    status = lab.status()
    return status.get("behavior") == "hover" and status.get("mode") == "armed"


@contextmanager
def laboratory() -> Iterator[tuple[Laboratory, int, int]]:
    """Yield a hovering laboratory with ports of MAVLink, UDP and TCP."""
    udp, tcp = free_port(), free_port()
    with tempfile.TemporaryDirectory(prefix="quadlab-doors-") as folder:
        lab = Laboratory(Path(folder))
        words = [sys.executable, "-m", "quadlab", "mavlink", f"udpin:127.0.0.1:{udp}"]
        more = [f"tcpin:127.0.0.1:{tcp}", "--loopback-port", str(lab.link_port)]
        gateway = subprocess.Popen([*words, *more], cwd=ROOT, stdout=subprocess.DEVNULL)
        try:
            lab.take_off(height=1.0, speed=1.0)
            lab.until("hover", lambda: is_hovering(lab))
            time.sleep(SETTLED)
            yield lab, udp, tcp
        finally:
            gateway.terminate()
            gateway.wait(15.0)
            lab.close()


def run(size: Size = Size.FULL, seed: int = 1) -> Report:
    """Attack every door. Raises QuadlabError when a laboratory does not start."""
    count = size.of(*BYTES)
    report = Report(
        "hostile_doors",
        "Hostile bytes at the sockets of a running laboratory",
        [f"about {count:,} bytes for each, seed {seed}; the vehicle hovers at 1 m"],
    )
    with (
        laboratory() as (lab, udp, tcp),
        page_socket(lab) as socket,
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
    ):
        marks = doors(lab, udp, tcp, count)
        quiet = quiet_latency(lab, socket)
        report.rows.append(Row("quiet", dict(quiet.figures())))
        keep_all(lab, size.of(KEPT, 0.0, 0.0))
        known, since = people(lab), newest_truth(lab.data)
        held: dict[str, Held] = {}
        for name, (attack, mark) in marks.items():
            before = memory(lab)
            held[name] = one = hold(lab, socket, pool.submit(attack, mark, seed), before)
            report.rows.append(
                Row(
                    name,
                    {
                        "obeyed": one.obeyed,
                        "took, s": one.took,
                        **one.latency.figures(),
                        "memory, MB": one.memory,
                        "hovers": "yes" if one.is_hovering else "**no**",
                    },
                )
            )
            print(report.rows[-1], file=sys.stderr, flush=True)
            if lab.up.poll() is not None:
                raise QuadlabError(f"{name}: the laboratory has ended: {lab.last_lines()}")
        away = moved(lab.data, since)
    report.targets = [
        Target("obeyed", sum(one.obeyed for one in held.values()), 0),
        Target(
            "doors after which it did not hover",
            sum(not one.is_hovering for one in held.values()),
            0,
        ),
        Target("people signed in or out", sum(abs(h.people - known) for h in held.values()), 0),
        Target("way from its place, m", away, MOVED),
        *(
            Target(
                f"{kind} of the page, ms",
                max(h.latency.figures()[f"{kind}, ms"] for h in held.values()),
                ANSWER,
            )
            for kind in ("answer median", "ping median")
        ),
        Target("memory, MB", sum(h.memory for h in held.values()), MEMORY),
    ]
    return report
