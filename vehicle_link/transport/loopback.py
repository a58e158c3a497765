"""Zenoh sessions on the station's loopback: web, simulator, tools."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from quadrotor.errors import LinkError
from vehicle_link.addresses import LOOPBACK

if TYPE_CHECKING:
    import zenoh

    Session = zenoh.Session
    """A session, for annotations outside this package, where Zenoh is not imported."""

RETRY = {
    "timeout_ms": -1,
    "exit_on_failure": False,
    # A first packet that is lost is not repeated within OPEN_S: many short attempts bring a
    # link back 0.4 s after an outage at the latest, fewer long ones 1 s.
    "retry": {"period_init_ms": 50, "period_max_ms": 100, "period_increase_factor": 2},
}
ONE_RECEIVER = "(rx: (worker_threads: 1))"
"""Zenoh's threads in a process whose only session is on loopback."""


def loopback_session(loopback_port: int, timeout: float = 5.0) -> zenoh.Session:
    """Open a client of the station's router: web, simulator, tools.

    Waits for a station to answer; once open, it reconnects by itself after the station's restart.

    Args:
        timeout: seconds to wait; a client that should start before its station tries again.

    Raises:
        LinkError: no station answered in time.
    """
    os.environ.setdefault("ZENOH_RUNTIME", ONE_RECEIVER)
    connect = {"endpoints": [f"tcp/{LOOPBACK}:{loopback_port}"], **RETRY}
    config: dict[str, object] = {
        "mode": "client",
        "connect": {**connect, "timeout_ms": round(1000 * timeout), "exit_on_failure": True},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    try:
        return open_session(config, f"{LOOPBACK}:{loopback_port}")
    except LinkError as error:
        raise LinkError(
            f"no station answered at {LOOPBACK}:{loopback_port} within {timeout:g} s; "
            "start it with `quadlab station` (or `quadlab up`)"
        ) from error


def open_session(config: dict[str, object], place: str) -> zenoh.Session:
    import zenoh

    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
    except zenoh.ZError as error:
        text = " ".join(str(error).split())
        if "in use" in text:
            raise LinkError(
                f"{place} is in use; stop the other quadlab, or choose another port"
            ) from error
        raise LinkError(f"cannot open a session on {place}: {text}") from error


class SharedSession:
    """Shared session; thread-safe. `open_session` returns a Zenoh session or raises LinkError."""

    def __init__(self, open_session: Callable[[], zenoh.Session]) -> None:
        self._open_session = open_session
        self._lock = threading.Lock()
        self._session: zenoh.Session | None = None
        self._users = 0

    def open(self) -> zenoh.Session:
        """Open the session or share the open one; release it with `close`. Raises LinkError."""
        with self._lock:
            if self._session is None:
                self._session = self._open_session()
            self._users += 1
            return self._session

    def close(self) -> None:
        """Release the session; after its last user it is closed, which may take long."""
        with self._lock:
            self._users -= 1
            if self._users:
                return
            session, self._session = self._session, None
        if session is not None:
            session.close()
