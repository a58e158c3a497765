"""The vehicle's own checks, as the station asks for them."""

from __future__ import annotations

from pathlib import Path

from vehicle.self_checks import SelfChecks, self_checks
from vehicle_link.authority import ensure_certificates
from vehicle_link.checks import from_messages
from vehicle_link.log.provenance import provenance
from vehicle_link.messages import new


def test_rights_disk_certificate_and_version_are_looked_at(tmp_path: Path) -> None:
    ensure_certificates(tmp_path / "certificates")
    answer = SelfChecks(tmp_path).answer(new("quadlab_msgs/srv/Checks_Request"))
    found = {one.name: one for one in from_messages(answer.checks)}
    assert {
        "clock", "real-time rights", "locked memory", "processor", "log's disk",
        "link's certificate", "firmware", "version",
    } == found.keys()  # fmt: skip
    assert {one.place for one in found.values()} == {"vehicle"}
    assert found["version"].found == provenance()["git_revision"]
    assert answer.accepted
    assert answer.checked > 0


def test_a_vehicle_without_its_certificate_says_so(tmp_path: Path) -> None:
    found = {one.name: one for one in self_checks(tmp_path)}
    assert found["link's certificate"].state == "fail"
