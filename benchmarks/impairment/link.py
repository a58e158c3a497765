"""Two ends and the relay between them, as one object to run programs on."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from types import TracebackType
from typing import Any, NamedTuple

from benchmarks.impairment.namespace import End, make_end
from benchmarks.impairment.wire import Conditions
from quadrotor.checkout import ROOT

A, B = "10.91.0.1", "10.91.0.2"
PATIENCE = 5.0
LEFT_OUT = ("http_proxy", "https_proxy", "all_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY")


class Counts(NamedTuple):
    """Packets of one direction, and the bytes of those that were carried."""

    sent: int
    lost: int
    overflowed: int
    bytes: int


class ImpairedLink:
    """An impaired link, used as `with ImpairedLink(seed) as link`.

    Raises StorageError where namespaces are not allowed.
    """

    def __init__(self, seed: int = 1) -> None:
        self._seed = seed
        self._ends: list[End] = []
        self._programs: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> ImpairedLink:
        self._ends = [make_end(A)]
        try:
            self._ends.append(make_end(B))
            self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            self._control.settimeout(PATIENCE)
            descriptors = [end.device for end in self._ends]
            with theirs:
                self._relay = subprocess.Popen(
                    [
                        sys.executable,
                        "-m",
                        "benchmarks.impairment.relay",
                        *map(str, descriptors),
                        str(theirs.fileno()),
                        str(self._seed),
                    ],
                    cwd=ROOT,
                    pass_fds=(*descriptors, theirs.fileno()),
                )
            self.change(Conditions())
        except BaseException:
            self._close_ends()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for program in reversed(self._programs):
            if program.poll() is None:
                program.terminate()
        for program in (*self._programs, self._relay):
            if program is self._relay:
                self._control.close()
            try:
                program.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()
        self._close_ends()

    def change(self, conditions: Conditions) -> tuple[Counts, Counts]:
        """Change both directions from now on; return what A and B have sent so far."""
        return self._order(conditions=asdict(conditions))

    def interrupt(self, seconds: float) -> tuple[Counts, Counts]:
        """Carry nothing for this many seconds."""
        return self._order(interrupt=seconds)

    def counts(self) -> tuple[Counts, Counts]:
        return self._order()

    def run(self, end: str, words: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
        """Start a program at the end with this address (A or B); it is ended with the link."""
        place = next(one for one in self._ends if one.address == end)
        environment = {k: v for k, v in os.environ.items() if k not in LEFT_OUT}
        program = subprocess.Popen(
            ["nsenter", f"--net=/proc/self/fd/{place.namespace}", *words],
            pass_fds=(place.namespace,),
            env=environment,
            **options,
        )
        self._programs.append(program)
        return program

    def _order(self, **order: Any) -> tuple[Counts, Counts]:
        self._control.send(json.dumps(order).encode())
        from_a, from_b = json.loads(self._control.recv(4096))
        return Counts(*from_a), Counts(*from_b)

    def _close_ends(self) -> None:
        for end in self._ends:
            end.close()
        self._ends = []
