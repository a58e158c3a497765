"""Vicon, OptiTrack (NatNet), Qualisys (QTM) and VRPN, through the library `motioncapture`.

The library holds the interpreter while it waits for a server that does not answer; with some
systems it waits for ever. It therefore runs in a separate process, which is ended when it is silent
for too long. It does not provide stamps of the system: frames are stamped on reception. A VRPN
client of the library looks for frames every 10 ms: they are stamped half way since the last look.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from console.trackers.source import Body, Connection, Frame
from quadrotor.errors import JobError, QuadlabError, UnreachableError
from vehicle_link.clock import monotonic_ns
from vehicle_link.jobs import Job

PATIENCE = 5.0
"""Seconds for a server to answer, and then for frames to arrive."""
POLL = 0.05
POLLED = "vrpn"
"""The library's client that returns every 10 ms, whether frames have come or not."""

Settings = Callable[[str, int], Mapping[str, str]]
"""Function that returns the library's settings for a server's address and port."""


class MotionCapture(NamedTuple):
    """A system that the library knows (`console.trackers.source.System`).

    Attributes:
        name: our name of the system. library: the library's name. settings: makes its settings.
    """

    name: str
    library: str
    settings: Settings

    def check(self, bodies: Mapping[str, str]) -> None:
        """Accept all names."""

    def open(self, connection: Connection) -> MotionCaptureSource:
        """Return the client, which has not connected yet. Raises UnreachableError."""
        return MotionCaptureSource(self, connection.host, connection.port)


VICON = MotionCapture("vicon", "vicon", lambda host, port: {"hostname": f"{host}:{port}"})
NATNET = MotionCapture(
    "natnet", "optitrack", lambda host, port: {"hostname": host, "port_command": str(port)}
)
QTM = MotionCapture("qtm", "qualisys", lambda host, port: {"hostname": host, "port": str(port)})
VRPN = MotionCapture("vrpn", "vrpn", lambda host, port: {"hostname": f"{host}:{port}"})


class MotionCaptureSource:
    """The client of a server. Raises UnreachableError."""

    def __init__(self, system: MotionCapture, host: str, port: int) -> None:
        self._server = f"{system.name} server at {host}:{port}"
        try:
            address = socket.gethostbyname(host)
        except OSError as error:
            raise UnreachableError(
                f"no host {host} is known ({error.strerror}); give the server's name or address "
                "with --host"
            ) from None
        self._order = system.library, dict(system.settings(address, port))
        self._closed = False

    def frames(self) -> Iterator[Frame]:
        """Yield each frame with a body. Raises UnreachableError when none arrives for PATIENCE."""
        frames: list[Any] = []
        job = Job(_read, *self._order, niceness=0, report=frames.append)
        last_frame_at, connected = math.inf, False  # the client has not started yet
        try:
            while not self._closed:
                if job.poll(POLL):
                    self._ended(job)
                if frames:
                    last_frame_at, connected = time.monotonic(), frames[-1][1] is not None
                for stamp, bodies in frames:
                    if bodies:
                        yield Frame(None, stamp, tuple(map(_body, bodies)))
                frames.clear()
                if time.monotonic() - last_frame_at > PATIENCE:
                    what = "sends nothing" if connected else "does not answer"
                    raise UnreachableError(
                        f"the {self._server} {what} for {PATIENCE:.0f} s; start it and its "
                        "streaming, check the network, or give another --host"
                    )
        finally:
            job.stop()

    def close(self) -> None:
        self._closed = True

    def _ended(self, job: Job[None]) -> None:
        try:
            job.result()
        except JobError as error:
            raise UnreachableError(f"the client of the {self._server}: {error}") from None
        except QuadlabError as error:
            raise UnreachableError(f"the {self._server} does not answer: {error}") from None


def _body(reported: tuple[str, list[float], list[float]]) -> Body:
    name, place, turn = reported
    return Body(name, np.array(place), np.array(turn))


def _read(system: str, settings: dict[str, str], report: Callable[[Any], None]) -> None:
    """Report each frame as (host's steady clock in ns, bodies), and None for the bodies when it
    starts to connect. Runs in a separate process.
    """
    import motioncapture

    report((monotonic_ns(), None))
    try:
        client = motioncapture.connect(system, settings)
    except RuntimeError as error:
        raise UnreachableError(str(error)) from None
    now = monotonic_ns()
    while True:
        looked = now
        client.waitForNextFrame()
        now = monotonic_ns()
        taken = looked + (now - looked) // 2 if system == POLLED else now
        bodies = [
            (
                name,
                [float(x) for x in body.position],
                [body.rotation.w, body.rotation.x, body.rotation.y, body.rotation.z],
            )
            for name, body in client.rigidBodies.items()
        ]
        if bodies or system != POLLED:  # the VRPN library wakes every 10 ms in any case
            report((taken, bodies))
