"""Checks of a computer: every possible result, and the advice for each."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from vehicle_link.checks import Check, from_messages, to_messages
from vehicle_link.machine_checks import (
    ClockWatch,
    clock_check,
    disk_check,
    governor_check,
    memory_lock_check,
    real_time_check,
)
from vehicle_link.messages import decode, encode, new
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.security.certificate_checks import SOON, certificate_check, validity_check

MB = 1_000_000
NOW = datetime.datetime(2030, 1, 1, tzinfo=datetime.UTC)


def not_told() -> tuple[bool, float]:
    raise OSError(38, "not implemented")


@pytest.mark.parametrize(
    ("answer", "state"), [((True, 0.002), "ok"), ((True, 0.5), "warn"), ((False, 16.0), "warn")]
)
def test_a_clock_is_synchronised_within_a_bound(answer: tuple[bool, float], state: str) -> None:
    assert clock_check("station", lambda: answer).state == state


def test_a_system_that_does_not_tell_is_not_called_good() -> None:
    assert clock_check("station", not_told).state == "unknown"


def test_this_computers_own_clock_is_asked_without_rights() -> None:
    assert clock_check("station").state in ("ok", "warn", "unknown")


def test_a_clock_that_jumps_is_noticed_and_one_that_is_slewed_is_not() -> None:
    wall, steady = [1000.0], [5.0]
    watch = ClockWatch(lambda: wall[0], lambda: steady[0])
    for _ in range(10):  # 500 ppm
        wall[0], steady[0] = wall[0] + 1.0005, steady[0] + 1.0
        watch.compare()
    assert watch.check("station").state == "ok"
    wall[0], steady[0] = wall[0] - 2.0, steady[0] + 1.0
    watch.compare()
    check = watch.check("station")
    assert (check.state, check.found) == ("warn", "once, the largest by -3.00 s")


@pytest.mark.parametrize(
    ("governors", "state"),
    [(["performance"] * 2, "ok"), (["performance", "powersave"], "warn"), ([], "ok")],
)
def test_a_processor_that_saves_power_is_worth_a_word(
    tmp_path: Path, governors: list[str], state: str
) -> None:
    for i, name in enumerate(governors):
        folder = tmp_path / f"sys/devices/system/cpu/cpu{i}/cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(f"{name}\n")
    assert governor_check("vehicle", tmp_path).state == state


def test_a_disk_is_judged_by_what_is_free_for_logs(tmp_path: Path) -> None:
    import shutil

    free = shutil.disk_usage(tmp_path).free
    assert disk_check("station", "disk", tmp_path / "runs", free / 10).state == "ok"
    assert disk_check("station", "disk", tmp_path, free / 2).state == "warn"
    full = disk_check("station", "disk", tmp_path, 2.0 * free)
    assert full.state == "fail"
    assert "delete or move" in full.advice


def test_rights_that_are_refused_come_with_the_line_to_write() -> None:
    refused = real_time_check("vehicle", 50, lambda priority: "Operation not permitted")
    assert refused.state == "fail"
    assert "rtprio 50' into /etc/security/limits.d/quadlab.conf" in refused.advice
    assert "setcap cap_sys_nice,cap_ipc_lock=ep /" in refused.advice
    assert real_time_check("vehicle", 50, lambda priority: "").state == "ok"


def test_trying_the_right_leaves_this_process_as_it_was() -> None:
    import os

    before = os.sched_getscheduler(0)
    assert real_time_check("vehicle", 50).state in ("ok", "fail")
    assert os.sched_getscheduler(0) == before


def test_a_limit_of_locked_memory_fails_unless_the_process_may_all_the_same() -> None:
    limited = memory_lock_check("vehicle", 8 * MB, capable=False)
    assert (limited.state, limited.found) == ("fail", "limit 8 MB")
    assert "memlock unlimited" in limited.advice
    assert memory_lock_check("vehicle", 8 * MB, capable=True).state == "ok"
    assert memory_lock_check("vehicle", -1, capable=False).state == "ok"


def test_a_certificate_of_ours_is_accepted_and_a_foreign_one_is_not(tmp_path: Path) -> None:
    ensure_certificates(tmp_path / "a", ["base.lab"])
    ensure_certificates(tmp_path / "b")
    good = certificate_check("station", tmp_path / "a", "station")
    assert good.state == "ok"
    assert "base.lab" in good.found
    (tmp_path / "a/station.pem").write_bytes((tmp_path / "b/station.pem").read_bytes())
    foreign = certificate_check("station", tmp_path / "a", "station")
    assert foreign.state == "fail"
    assert "not signed by" in foreign.advice
    assert certificate_check("station", tmp_path / "none", "station").state == "fail"


@pytest.mark.parametrize(("days", "state"), [(SOON + 1, "ok"), (SOON - 1, "warn"), (-1, "fail")])
def test_a_certificate_is_judged_by_the_days_it_has_left(days: int, state: str) -> None:
    end = NOW + datetime.timedelta(days=days)
    assert validity_check("page", "certificate", end, ["base.lab"], NOW).state == state


def test_checks_come_back_as_they_were_sent_and_one_that_is_ok_needs_no_advice() -> None:
    sent = [
        Check("disk", "fail", "1 MB free", "500 MB free", "delete runs", "vehicle"),
        Check("clock", "ok", "synchronised", "synchronised", "start chrony", "station"),
    ]
    message = new("quadlab_msgs/srv/Checks_Response", accepted=True, checks=to_messages(sent))
    came = decode(encode(message), "quadlab_msgs/srv/Checks_Response")
    first, second = from_messages(came.checks)
    assert first == sent[0]
    assert second == Check("clock", "ok", "synchronised", "synchronised", "", "station")


def test_a_state_of_another_version_is_not_known() -> None:
    message = new("quadlab_msgs/Check", name="disk", state="splendid", place="moon")
    [check] = from_messages([message])
    assert (check.state, check.place) == ("unknown", "station")
