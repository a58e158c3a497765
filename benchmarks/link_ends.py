"""The two programs of `python -m benchmarks link`, one at each end of the impaired link.

    python -m benchmarks.link_ends vehicle|station FOLDER SECONDS

Both share CLOCK_MONOTONIC. The vehicle sends telemetry over the project's session, beside it the
same bytes by plain UDP, a packet of each 100 times a second; the station notes when each came, and
calls a service five times a second. The station writes what it noted as FOLDER/<name>.npz.
"""

from __future__ import annotations

import gc
import itertools
import socket
import struct
import sys
import threading
import time
from pathlib import Path

import numpy as np

from benchmarks.impairment.link import A, B
from quadrotor.errors import LinkError
from vehicle_link.authority import ensure_certificates
from vehicle_link.messages import new
from vehicle_link.node import Node, Received
from vehicle_link.session import station_session, vehicle_session, wait_connected
from vehicle_link.topics import SERVICES, TOPICS

QUIC_PORT, UDP_PORT, LOOPBACK_PORT = 7447, 9100, 7447
RATE = 100
SIZE = 1100
"""Bytes of a packet, as telemetry has at most."""
CALLS = 5
"""A second."""
CALL_TIMEOUT, CALL_TRIES = 1.0, 5
"""As a parameter is set: asked again under the same id."""
KIND = SERVICES["arm"]
_STAMP = struct.Struct("<qq")  # number, ns


def vehicle(folder: Path, seconds: float) -> None:
    session = vehicle_session(QUIC_PORT, ensure_certificates(folder, [A]))
    node = Node(session, "/quad1", "vehicle")
    node.serve("arm", KIND, lambda request: new(f"{KIND}_Response", accepted=True))
    publisher = node.advertise(TOPICS["telemetry"])
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    print("up", flush=True)
    gc.freeze()
    gc.disable()
    began = time.monotonic()
    for k in itertools.count():
        time.sleep(max(0.0, began + k / RATE - time.monotonic()))
        if time.monotonic() - began > seconds:
            break
        # In turns, so that neither is always the first.
        for way in ((0, 1), (1, 0))[k % 2]:
            payload = _STAMP.pack(k, time.monotonic_ns()) + bytes(SIZE - _STAMP.size)
            if way == 0:
                publisher.put(payload)
            else:
                udp.sendto(payload, (B, UDP_PORT))
    time.sleep(2.0)  # for answers on their way
    node.close()
    session.close()


def station(folder: Path, seconds: float, out: Path) -> None:
    session = station_session(f"{A}:{QUIC_PORT}", LOOPBACK_PORT, ensure_certificates(folder, [A]))
    node = Node(session, "/quad1", "station")
    heard: dict[str, list[tuple[int, int, int]]] = {"zenoh": [], "udp": []}
    calls: list[tuple[int, int]] = []  # when asked, ns until answered or -1

    def note(way: str, payload: bytes) -> None:
        heard[way].append((*_STAMP.unpack_from(payload), time.monotonic_ns()))

    def hear(received: Received) -> None:
        note("zenoh", received.payload)

    row = TOPICS["telemetry"]
    node.subscribe(row.name, row.type_name, hear, qos=row.qos, direct=True)
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.bind((B, UDP_PORT))

    def listen() -> None:
        while data := udp.recv(2000):
            note("udp", data)

    threading.Thread(target=listen, daemon=True).start()
    client = node.client("arm", KIND)
    wait_connected(session, 10.0)
    client.wait(10.0)
    print("up", flush=True)

    def ask() -> None:
        began = time.monotonic_ns()
        request = new(f"{KIND}_Request", request_id=str(began), requester="benchmark")
        for _ in range(CALL_TRIES):
            try:
                client.call(request, timeout=CALL_TIMEOUT)
            except LinkError:
                continue
            calls.append((began, time.monotonic_ns() - began))
            return
        calls.append((began, -1))

    began, threads = time.monotonic(), []
    for k in range(int(seconds * CALLS)):
        time.sleep(max(0.0, began + k / CALLS - time.monotonic()))
        threads.append(threading.Thread(target=ask, daemon=True))
        threads[-1].start()
    for thread in threads:
        thread.join(CALL_TRIES * CALL_TIMEOUT + 1.0)
    notes = {way: np.array(rows, np.int64).reshape(-1, 3) for way, rows in heard.items()}
    np.savez(out, **notes, calls=np.array(calls, np.int64).reshape(-1, 2))
    node.close()
    session.close()


if __name__ == "__main__":
    which, place, duration = sys.argv[1], Path(sys.argv[2]), float(sys.argv[3])
    if which == "vehicle":
        vehicle(place, duration)
    else:
        station(place, duration, place / "notes.npz")
