"""Real-time scheduling and locked memory for the flight loop, as far as Linux grants them."""

from __future__ import annotations

import ctypes
import gc
import os
from dataclasses import dataclass
from pathlib import Path

PRIORITY = 50  # SCHED_FIFO: above every ordinary thread, below the kernel's interrupt threads
# ONFAULT: only touched pages are locked; locking all that is mapped would take 300 MB.
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


@dataclass(frozen=True, slots=True)
class RealTime:
    """The real-time privileges that were granted."""

    scheduled: bool  # SCHED_FIFO
    locked: bool  # no page of this process is ever swapped out
    refusal: str  # one line, empty when everything was granted


def become_real_time() -> RealTime:
    """Ask for SCHED_FIFO and locked memory for the calling process; never raises."""
    refusals = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        scheduled = True
    except OSError as error:
        scheduled = False
        refusals.append(f"SCHED_FIFO {PRIORITY} refused ({error.strerror})")
    libc = ctypes.CDLL(None, use_errno=True)
    locked = libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0
    if not locked:
        refusals.append(f"mlockall refused ({os.strerror(ctypes.get_errno())})")
    elif not locked_kilobytes():
        locked = False
        refusals.append("mlockall granted, but the kernel counts no locked memory (VmLck is 0)")
    refusal = ""
    if refusals:
        refusal = (
            f"not real time: {', '.join(refusals)}; the loop will be late under load. "
            "Give the user rtprio 50 and memlock unlimited in /etc/security/limits.conf, "
            "or CAP_SYS_NICE and CAP_IPC_LOCK"
        )
    return RealTime(scheduled, locked, refusal)


def locked_kilobytes(status: Path = Path("/proc/self/status")) -> int:
    """Return memory of this process that the kernel keeps from being swapped out (VmLck)."""
    for line in status.read_text().splitlines():
        if line.startswith("VmLck:"):
            return int(line.split()[1])
    return 0


def freeze_garbage() -> None:
    """Freeze and stop garbage collection: collecting 300 k objects stops the loop for 66 ms."""
    gc.collect()
    gc.freeze()
    gc.disable()
