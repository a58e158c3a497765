"""Checks that each end of the link makes on its own computer: clock, processor, disk, rights.

Nothing here changes the computer, except for a thread that tries a right and gives it back. Each
function returns a Check; what the computer does not report is `unknown`, never an error.
"""

from __future__ import annotations

import ctypes
import os
import pwd
import resource
import shutil
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from vehicle_link.checks import Check, Place, State

ROOT = Path("/")
CLOCK_ERROR = 0.1
"""Error bound of the kernel's clock, in s, above which there is a warning."""
ROOM = 4.0
"""Multiple of the space to keep free, below which there is a warning."""
_UNSYNCHRONISED = 0x40  # STA_UNSYNC of adjtimex(2)
_LOCK_MEMORY = 14  # CAP_IPC_LOCK, its bit of CapEff


class _Timex(ctypes.Structure):
    """The head of struct timex; the kernel writes the rest into `tail`."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        *((name, ctypes.c_long) for name in ("offset", "frequency", "largest", "estimated")),
        ("status", ctypes.c_int),
        ("tail", ctypes.c_byte * 320),
    )


def kernel_clock() -> tuple[bool, float]:
    """Return whether the kernel calls its clock synchronised, and its error bound in s. Raises
    OSError.
    """
    timex = _Timex()  # modes = 0: only reads
    if ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex)) < 0:
        raise OSError(ctypes.get_errno(), "adjtimex")
    return not timex.status & _UNSYNCHRONISED, timex.largest * 1e-6


def clock_check(place: Place, ask: Callable[[], tuple[bool, float]] = kernel_clock) -> Check:
    wanted = "synchronised"
    try:
        synchronised, error = ask()
    except (OSError, AttributeError):
        return Check("clock", "unknown", "not reported by this system", wanted, place=place)
    if not synchronised:
        return Check(
            "clock",
            "warn",
            "not synchronised",
            wanted,
            "start chrony or systemd-timesyncd; runs are named and dated by this clock",
            place,
        )
    state: State = "ok" if error <= CLOCK_ERROR else "warn"
    return Check(
        "clock",
        state,
        f"synchronised within {1e3 * error:.0f} ms",
        f"within {1e3 * CLOCK_ERROR:.0f} ms",
        "wait, or give it a nearer time server",
        place,
    )


def governor_check(place: Place, root: Path = ROOT) -> Check:
    """Check how the processor chooses its frequency."""
    paths = sorted((root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    name, wanted = "processor", "governor performance"
    try:
        found = sorted({path.read_text().strip() for path in paths})
    except OSError:
        found = []
    if not found:
        text = "no governor here (a virtual machine, or fixed)"
        return Check(name, "ok", text, wanted, place=place)
    state: State = "ok" if found == ["performance"] else "warn"
    advice = "sudo cpupower frequency-set -g performance: a clock that rises late makes ticks late"
    return Check(name, state, f"governor {', '.join(found)}", wanted, advice, place)


def disk_check(place: Place, name: str, folder: Path, keep_free: float) -> Check:
    """Check whether logs can be written into `folder`; `keep_free` is in bytes."""
    wanted = f"writable, {_size(keep_free)} free"
    there = next((one for one in (folder, *folder.parents) if one.exists()), folder)
    try:
        free = shutil.disk_usage(there).free
    except OSError as error:
        advice = f"is the disk of {folder} mounted?"
        return Check(name, "fail", f"not reached ({error.strerror})", wanted, advice, place)
    if not os.access(there, os.W_OK | os.X_OK):
        advice = f"correct the permissions of {there}, or choose another folder with --data"
        return Check(name, "fail", f"{there} is not writable", wanted, advice, place)
    state: State = "ok" if free >= ROOM * keep_free else "warn" if free >= keep_free else "fail"
    return Check(
        name, state, f"{_size(free)} free", wanted, f"delete or move logs of {folder}", place
    )


def real_time_check(
    place: Place, priority: int, attempt: Callable[[int], str] | None = None
) -> Check:
    """Check whether SCHED_FIFO is granted: a thread tries it and gives it back at once."""
    refusal = (attempt or _try_priority)(priority)
    name, wanted = "real-time rights", f"SCHED_FIFO {priority}"
    if not refusal:
        return Check(name, "ok", f"SCHED_FIFO {priority} granted", wanted, place=place)
    advice = (
        f"write '{_user()} - rtprio {priority}' into /etc/security/limits.d/quadlab.conf and sign "
        f"in again, or: {_capabilities()}"
    )
    return Check(name, "fail", f"SCHED_FIFO {priority} refused ({refusal})", wanted, advice, place)


def memory_lock_check(
    place: Place, limit: int | None = None, *, capable: bool | None = None
) -> Check:
    """Check whether memory may be locked against swapping. `limit` is in bytes, -1 for none."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] if limit is None else limit
    capable = _has_capability(_LOCK_MEMORY) if capable is None else capable
    name, wanted = "locked memory", "no limit"
    if capable or limit == resource.RLIM_INFINITY:
        return Check(name, "ok", "no limit", wanted, place=place)
    advice = (
        f"write '{_user()} - memlock unlimited' into /etc/security/limits.d/quadlab.conf and sign "
        f"in again, or: {_capabilities()}"
    )
    return Check(name, "fail", f"limit {_size(limit)}", wanted, advice, place)


class ClockWatch:
    """Counter of jumps of the system's clock against the steady clock; times in s."""

    SMALLEST = 0.05

    def __init__(
        self, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._wall, self._steady = wall, steady
        self._ahead = wall() - steady()
        self.jumps = 0
        self.largest = 0.0

    def compare(self) -> None:
        """Compare the clocks, several times a minute: slewing between two calls is not a jump."""
        ahead = self._wall() - self._steady()
        jump, self._ahead = ahead - self._ahead, ahead
        if abs(jump) >= self.SMALLEST:
            self.jumps += 1
            self.largest = max(self.largest, jump, key=abs)

    def check(self, place: Place) -> Check:
        name, wanted = "clock jumps", "none since the start"
        if not self.jumps:
            return Check(name, "ok", "none", wanted, place=place)
        times = "once" if self.jumps == 1 else f"{self.jumps} times"
        found = f"{times}, the largest by {self.largest:+.2f} s"
        advice = "let the clock settle before a flight: stamps of a run that spans a jump disagree"
        return Check(name, "warn", found, wanted, advice, place)


def _try_priority(priority: int) -> str:
    """Try a priority; return "" when it is granted, else the system's message. It runs in a thread,
    because the priority belongs to a thread.
    """
    refusal: list[str] = []

    def attempt() -> None:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            os.sched_setscheduler(0, *before)
        except OSError as error:
            refusal.append(error.strerror or str(error))

    thread = threading.Thread(target=attempt, name="rights")
    thread.start()
    thread.join()
    return refusal[0] if refusal else ""


def _has_capability(bit: int) -> bool:
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return False
    held = next((line for line in status.splitlines() if line.startswith("CapEff:")), "CapEff: 0")
    return bool(int(held.split()[1], 16) >> bit & 1)


def _capabilities() -> str:
    return f"sudo setcap cap_sys_nice,cap_ipc_lock=ep {os.path.realpath(sys.executable)}"


def _user() -> str:
    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return str(os.getuid())


def _size(count: float) -> str:
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return (
                f"{count / size:.3g} {unit}"
                if count < 1000 * size
                else f"{count / size:.0f} {unit}"
            )
    return f"{count:.0f} B"
