"""The vehicle's own checks, as the station requests them; never during a flight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from flight_log.provenance import provenance
from quadrotor.errors import RefusedError
from vehicle.comms.self_checks import ARMED_VALID, SelfChecks, self_checks
from vehicle_link.checks import Check, from_messages
from vehicle_link.messages import new
from vehicle_link.security.authority import ensure_certificates

REQUEST: Any = new("quadlab_msgs/srv/Checks_Request")


def lines(answer: Any) -> dict[str, Check]:
    return {one.name: one for one in from_messages(answer.checks)}


def test_rights_disk_certificate_and_version_are_looked_at(tmp_path: Path) -> None:
    ensure_certificates(tmp_path / "certificates")
    checks = SelfChecks(tmp_path)
    checks.note_armed(False)
    answer = checks.answer(REQUEST)
    found = lines(answer)
    assert {
        "clock",
        "real-time rights",
        "locked memory",
        "processor",
        "log's disk",
        "link's certificate",
        "firmware",
        "version",
    } == found.keys()
    assert {one.place for one in found.values()} == {"vehicle"}
    assert found["log's disk"].found.endswith(" free")
    assert found["version"].found == provenance()["git_revision"]
    assert answer.accepted
    assert answer.checked > 0


def test_a_vehicle_without_its_certificate_says_so(tmp_path: Path) -> None:
    found = {one.name: one for one in self_checks(tmp_path, disarmed=True)}
    assert found["link's certificate"].state == "fail"


def test_an_armed_vehicle_refuses(tmp_path: Path) -> None:
    checks = SelfChecks(tmp_path)
    checks.note_armed(True)
    with pytest.raises(RefusedError, match="on the ground"):
        checks.answer(REQUEST)


@pytest.mark.parametrize("told", [None, False, True])
def test_while_the_flight_loop_is_silent_the_disk_is_left_alone_and_said_so(
    tmp_path: Path, told: bool | None
) -> None:
    now = 0.0
    checks = SelfChecks(tmp_path, clock=lambda: now)
    if told is not None:
        checks.note_armed(told)
    now = 2.0 * ARMED_VALID
    answer = checks.answer(REQUEST)
    assert answer.accepted
    disk = lines(answer)["log's disk"]
    assert disk.state == "unknown"
    assert disk.found == "not checked: no data from the flight loop, which may be flying"
    assert disk.advice


class FullLog:
    """Log of a vehicle whose disk is full."""

    problem = ""
    stop_bytes = 10**15


def test_a_log_that_stopped_fails_until_the_next_flight_is_logged(tmp_path: Path) -> None:
    log = FullLog()
    checks = SelfChecks(tmp_path, log=log)
    checks.note_armed(False)
    found = lines(checks.answer(REQUEST))
    assert (found["onboard log"].state, found["onboard log"].found) == ("ok", "nothing was lost")
    assert found["log's disk"].state == "fail", "by the limit of this vehicle's log"
    log.problem = "499 MB free, needs 500 MB"
    stopped = lines(checks.answer(REQUEST))["onboard log"]
    assert stopped.state == "fail"
    assert stopped.found == "stopped: 499 MB free, needs 500 MB"
    assert "make room on the vehicle's disk" in stopped.advice
