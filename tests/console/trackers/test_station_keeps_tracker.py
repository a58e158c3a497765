"""`quadlab station --tracker` starts the tracker process, and again when it dies."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

from quadrotor.errors import LinkError
from tests.waiting import free_port, until, wait_for
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node


def trackers(parent: int) -> list[int]:
    """Return the process ids of its tracker processes."""
    listed = Path(f"/proc/{parent}/task").glob("*/children")
    pids = [int(pid) for one in listed for pid in one.read_text().split()]
    return [pid for pid in pids if b"\0tracker\0" in Path(f"/proc/{pid}/cmdline").read_bytes()]


def has_ended(pid: int) -> bool:
    try:
        return ") Z " in Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return True


def session_with(port: int) -> Any:
    try:
        return loopback_session(port, timeout=1.0)
    except LinkError:
        return None


def test_a_tracker_process_that_dies_is_started_again_and_ends_with_its_station(
    tmp_path: Path,
) -> None:
    port, vehicle, udp = free_port(), free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_DGRAM)
    words = ["station", "--data", str(tmp_path), "--loopback-port", str(port)]
    words += ["--vehicle", f"127.0.0.1:{vehicle}", "--tracker", f"udp --port {udp}"]
    station = subprocess.Popen([sys.executable, "-m", "quadlab", *words])
    try:
        session = until(lambda: session_with(port))
        page = Node(session, "/quad1", "page")
        gids: list[bytes] = []
        topic = TOPICS["tracker_status"]
        page.subscribe(topic.name, topic.type_name, lambda received: gids.append(received.gid))
        wait_for(lambda: gids)
        [tracker] = trackers(station.pid)
        os.kill(tracker, signal.SIGKILL)
        wait_for(lambda: len(set(gids)) == 2)
        [tracker] = trackers(station.pid)
        page.close()
        session.close()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.2", udp))  # it listens at 127.0.0.1, not everywhere
    finally:
        station.terminate()
        station.wait(30)
    wait_for(lambda: has_ended(tracker))
