"""The radio of one vehicle: the session that dials it and joins it to the hub, opened again when it
is connected but delivers nothing.

Nothing here blocks a caller: sessions are opened, watched and abandoned by separate threads, and
neither the hub nor another vehicle's radio is affected.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

import zenoh

from quadrotor.errors import LinkError
from vehicle_link.addresses import parse_endpoint
from vehicle_link.security.authority import TlsFiles
from vehicle_link.transport.session import check_station, radio_session
from vehicle_link.transport.unused_memory import trim_heaps


def namespaces(session: zenoh.Session, timeout: float = 1.0) -> set[str]:
    """Return the namespaces of the nodes there (`quad1`) that this session may see; asks over the
    link.
    """
    found: set[str] = set()
    try:
        links = session.info.links()
        for zid in {str(link.zid) for link in links if link.dst.startswith("quic/")}:
            for reply in session.liveliness().get(f"@ros2_lv/*/{zid}/**", timeout=timeout):
                if reply.ok is not None:
                    # @ros2_lv/domain/session/node/endpoint/kind/enclave/namespace/…
                    found.add(str(reply.ok.key_expr).split("/")[7].strip("%"))
    except zenoh.ZError:  # closed in the meantime
        return set()
    return found - {""}


REOPEN_AFTER = 2.0
"""Seconds without data over a connected link after which its session is opened again."""
LONGEST = 60.0
"""Longest patience in s: each attempt in vain doubles it, so that a vehicle that hangs is not
flooded with attempts."""
LOOK, LOOK_CLOSELY = 0.1, 0.03  # s
OUTAGE_AFTER = 0.4
"""Seconds without data from the vehicle over any path that make an outage."""
ANSWER_WITHIN = 0.2
"""Seconds after an outage in which a session that stayed connected must deliver an answer; if not,
it is opened again."""
ABANDONED = "abandoned radio"


def infinite_silence() -> float:
    """Return the seconds since an event that never happened: inf."""
    return math.inf


def is_hanging_up() -> bool:
    """Return whether a session of any radio is still being closed: until then only os._exit ends a
    process.
    """
    return any(thread.name.startswith(ABANDONED) for thread in threading.enumerate())


class OutageDetector:
    """Detector of outages of all data from a vehicle.

    QUIC doubles its pause before each probe whether the other end is alive (RFC 9002, section 6.2):
    after an outage shorter than Zenoh's lease either end may stay idle for as long again, while a
    new session is up in 0.1 s.
    """

    def __init__(self) -> None:
        self._lasted = 0.0

    def ended(self, unheard: float) -> float:
        """Return the duration of the outage in s, once, when the vehicle is received again; else
        0.
        """
        if unheard > OUTAGE_AFTER:
            self._lasted = unheard
            return 0.0
        lasted, self._lasted = self._lasted, 0.0
        return lasted


class Radio:
    """The link to one vehicle, until it is closed.

    Args:
        endpoint: `host`, `host:port` or `quic/host:port`.
        loopback_port: of the hub.
        session_silence: returns the seconds since data arrived from the vehicle over its session
            (not by the lane); inf before the first. Called in a thread of the radio.
        lane_silence: the same for data that arrived outside the session.
        probe: returns whether the vehicle answers over the session within so many seconds;
            called in the same thread, after an outage.
        report: called with a line when a session is opened again.

    Raises:
        LinkError: a certificate does not fit.
        UsageError: the endpoint cannot be parsed.
    """

    def __init__(
        self,
        endpoint: str,
        tls: TlsFiles,
        loopback_port: int,
        session_silence: Callable[[], float],
        report: Callable[[str], None] = lambda line: None,
        lane_silence: Callable[[], float] = infinite_silence,
        probe: Callable[[float], bool] = lambda timeout: True,
    ) -> None:
        check_station(endpoint, tls)
        host, port = parse_endpoint(endpoint)
        self.address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self.reopened = 0
        self._unopened = ""
        self._endpoint, self._tls = endpoint, tls
        self._loopback_port = loopback_port
        self._session_silence, self._lane_silence = session_silence, lane_silence
        self._probe, self._report = probe, report
        self._session: zenoh.Session | None = None
        self._connected = threading.Event()
        self._connected_since = 0.0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"radio {host}", daemon=True)
        self._thread.start()

    @property
    def connected(self) -> bool:
        """Return whether the link is connected: certificates are accepted, and the other end is
        alive.
        """
        return self._connected.is_set()

    @property
    def connected_for(self) -> float:
        """Return the seconds for which the link has been connected; 0 when it is not."""
        return time.monotonic() - self._connected_since if self._connected.is_set() else 0.0

    def wait(self, timeout: float) -> bool:
        """Wait for the link for at most `timeout` seconds; return whether it is connected."""
        return self._connected.wait(timeout)

    def names(self) -> set[str]:
        """Return the namespaces of the nodes at the other end; asks it, for at most a second."""
        session = self._session
        return set() if session is None else namespaces(session)

    def problem(self) -> str:
        """Return why no session can be opened, or which of our files no vehicle accepts; reads the
        files.
        """
        try:
            check_station(self._endpoint, self._tls)
        except LinkError as error:
            return str(error)
        return self._unopened

    def close(self, patience: float = 0.0) -> None:
        """Hang up, waiting at most `patience` seconds; it may take ten if the vehicle is away."""
        self._closing.set()
        self._thread.join(patience)

    def _run(self) -> None:
        patience = REOPEN_AFTER
        while not self._closing.is_set():
            try:
                session = radio_session(self._endpoint, self._tls, self._loopback_port)
            except LinkError as error:  # missing files or no memory: may be temporary
                self._unopened = str(error)
                self._report(f"radio to {self.address}: {error}; trying again in {patience:g} s")
                self._closing.wait(patience)
                patience = min(2 * patience, LONGEST)
                continue
            self._session, self._unopened = session, ""
            patience = self._watch(session, patience)
            self._connected.clear()
            self._session = None
            abandoned = threading.Thread(
                target=session.close, name=f"{ABANDONED} {self.address}", daemon=True
            )
            abandoned.start()
            if self._closing.is_set():
                abandoned.join()

    def _watch(self, session: zenoh.Session, patience: float) -> float:
        """Watch until the session has to be closed; return the patience for the next one."""

        def changed(event: zenoh.LinkEvent) -> None:
            if not event.link.dst.startswith("quic/"):
                return
            if event.kind == zenoh.SampleKind.PUT:
                self._connected_since = time.monotonic()
                self._connected.set()
            else:
                self._connected.clear()

        outage = OutageDetector()
        with session.info.declare_link_events_listener(changed, history=True):
            session_silence = 0.0
            while not self._closing.wait(LOOK if session_silence < OUTAGE_AFTER else LOOK_CLOSELY):
                connected_for, session_silence = self.connected_for, self._session_silence()
                lasted = outage.ended(min(session_silence, self._lane_silence()))
                if lasted:
                    trim_heaps()
                if 0.0 < lasted < connected_for and not self._probe(ANSWER_WITHIN):
                    self.reopened += 1
                    return patience
                if session_silence < min(connected_for, REOPEN_AFTER):
                    patience = REOPEN_AFTER  # this one works
                elif connected_for > patience:
                    self.reopened += 1
                    self._report(
                        f"the link to {self.address} is open but delivered nothing for "
                        f"{patience:g} s: reopened"
                    )
                    return min(2 * patience, LONGEST)
        return patience
