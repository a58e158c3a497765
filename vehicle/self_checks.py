"""What the vehicle looks at on its own computer when the station asks: rights, disk, certificate.

Asked at the station's start and from the Set-up page, never while the vehicle is armed.
"""

from __future__ import annotations

import time
from pathlib import Path

from vehicle.microcontroller import FIRMWARE_REVISION
from vehicle.onboard_log import FREE_BYTES_MIN
from vehicle.realtime import PRIORITY
from vehicle_link.certificate_checks import certificate_check
from vehicle_link.checks import Check, Place, to_messages
from vehicle_link.log.provenance import provenance
from vehicle_link.machine_checks import (
    clock_check,
    disk_check,
    governor_check,
    memory_lock_check,
    real_time_check,
)
from vehicle_link.messages import Message, new
from vehicle_link.topics import SERVICES

PLACE: Place = "vehicle"
_FIRMWARE = f"revision {FIRMWARE_REVISION}; the motors start with no other"
VERSION = "version"
"""The check whose `found` the station compares with its own revision."""


def self_checks(data: Path) -> list[Check]:
    """Of the computer this runs on; `data`: the vehicle's data folder."""
    return [
        clock_check(PLACE),
        real_time_check(PLACE, PRIORITY),
        memory_lock_check(PLACE),
        governor_check(PLACE),
        disk_check(PLACE, "log's disk", data / "onboard", FREE_BYTES_MIN),
        certificate_check(PLACE, data / "certificates", "vehicle"),
        Check("firmware", "ok", _FIRMWARE, place=PLACE),
        Check(VERSION, "ok", provenance()["git_revision"], place=PLACE),
    ]


class SelfChecks:
    """Serves `checks`; `answer` runs in the service's own thread."""

    def __init__(self, data: Path) -> None:
        self._data = data

    def answer(self, request: Message) -> Message:
        """Looks each time: the station keeps what was found."""
        checks = to_messages(self_checks(self._data))
        return new(
            f"{SERVICES['checks']}_Response", accepted=True, checked=time.time(), checks=checks
        )
