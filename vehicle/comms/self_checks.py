"""The checks of the vehicle's own computer for the station: privileges, disk, certificate.

Requested at the station's start and from the Settings page. Refused while the vehicle is armed;
while its flight loop is silent, and so may be flying, the disk is not accessed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from flight_log.provenance import provenance
from quadrotor.errors import RefusedError
from vehicle.onboard_log.parameters import OnboardLogParameters
from vehicle.onboard_log.repair import FOLDER
from vehicle.realtime import PRIORITY
from vehicle_link.checks import Check, Place, to_messages
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.machine_checks import (
    clock_check,
    disk_check,
    governor_check,
    memory_lock_check,
    real_time_check,
)
from vehicle_link.messages import new
from vehicle_link.messages.records import ChecksRequest, ChecksResponse
from vehicle_link.security.certificate_checks import certificate_check

PLACE: Place = "vehicle"
VERSION = "version"
"""Name of the check whose `found` the station compares with its own revision."""


STOP_BYTES = OnboardLogParameters().stop_bytes

ARMED_VALID = 0.5
"""Seconds after which the flight loop's last report of whether it is armed is out of date."""


class Log(Protocol):
    """The part of the onboard log that is checked.

    Attributes:
        problem: why the last flight's log is incomplete, empty when it is complete.
        stop_bytes: free space, in bytes, below which nothing is logged.
    """

    problem: str

    @property
    def stop_bytes(self) -> int: ...


def self_checks(
    data: Path, *, disarmed: bool, identity: Identity = THE_ONE, log: Log | None = None
) -> list[Check]:
    """Check the computer that this process runs on.

    Args:
        data: the vehicle's data folder.
        disarmed: whether it is known to be disarmed; if not, the disk is not accessed.
        identity: of the microcontroller.
        log: the vehicle's own log.
    """
    disk = Check(
        "log's disk",
        "unknown",
        "not checked: no data from the flight loop, which may be flying",
        advice="start the flight process and its microcontroller, then check again",
        place=PLACE,
    )
    if disarmed:
        least = STOP_BYTES if log is None else log.stop_bytes
        disk = disk_check(PLACE, "log's disk", data / FOLDER, least)
    firmware = f"revision {identity.firmware}; the motors start with this one only"
    return [
        clock_check(PLACE),
        real_time_check(PLACE, PRIORITY),
        memory_lock_check(PLACE),
        governor_check(PLACE),
        disk,
        *([] if log is None else [log_check(log.problem)]),
        certificate_check(PLACE, data / "certificates", "vehicle"),
        Check("firmware", "ok", firmware, place=PLACE),
        Check(VERSION, "ok", provenance()["git_revision"], place=PLACE),
    ]


def log_check(problem: str) -> Check:
    """Check whether the last flight was logged completely."""
    if not problem:
        return Check("onboard log", "ok", "nothing was lost", place=PLACE)
    advice = "make room on the vehicle's disk, leave the log's folder alone; arming tries again"
    return Check("onboard log", "fail", f"stopped: {problem}", "every tick", advice, PLACE)


class SelfChecks:
    """Service `checks`; `answer` runs in the service's own thread.

    Args:
        clock: s, steady.
    """

    def __init__(
        self,
        data: Path,
        clock: Callable[[], float] = time.monotonic,
        identity: Identity = THE_ONE,
        log: Log | None = None,
    ) -> None:
        self._data, self._clock, self._identity, self._log = data, clock, identity, log
        self._newest: tuple[float, bool] | None = None

    def note_armed(self, armed: bool) -> None:
        """Store whether the flight loop's newest tick is armed."""
        self._newest = (self._clock(), armed)

    @property
    def armed(self) -> bool | None:
        """Return whether the vehicle is armed; None while it is not known."""
        newest = self._newest
        return None if newest is None or self._clock() - newest[0] > ARMED_VALID else newest[1]

    def answer(self, request: ChecksRequest) -> ChecksResponse:
        """Run the checks on each request; the station stores the results."""
        armed = self.armed
        if armed:
            raise RefusedError("the vehicle is armed; checks are made on the ground")
        checks = to_messages(
            self_checks(self._data, disarmed=armed is False, identity=self._identity, log=self._log)
        )
        return new(
            "quadlab_msgs/srv/Checks_Response", accepted=True, checked=time.time(), checks=checks
        )
