"""The certificates of the link, once the computer's clock allows them."""

from __future__ import annotations

from pathlib import Path

from quadrotor.errors import ClockNotSetError
from vehicle.processes.terminal import say
from vehicle_link.security.authority import TlsFiles, ensure_certificates
from vehicle_link.termination_signal import Ending

CLOCK_CHECK_S = 0.5


def certificates_in_time(folder: Path, stopping: Ending) -> TlsFiles | None:
    """Return the certificates once the computer's clock allows them; None when stopped before.

    A computer without a battery for its clock starts in 1970, and is set right later.
    """
    is_told = False
    while True:
        try:
            return ensure_certificates(folder)
        except ClockNotSetError as error:
            if not is_told:
                say(f"{error}; until then no base is connected and nothing flies")
            is_told = True
        if stopping.wait(CLOCK_CHECK_S):
            return None
