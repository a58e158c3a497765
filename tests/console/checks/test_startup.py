"""The start-up checks run once there is something to measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from console.checks.facts import Facts
from console.checks.startup import (
    SETTLE,
    WITHOUT_STATUS,
    WITHOUT_TRACKER,
    WITHOUT_VEHICLE,
    StartupChecks,
)
from console.checks.station_items import rates
from console.parameters.station import station_parameters
from quadrotor.errors import LinkError
from vehicle_link.checks import Check, to_messages
from vehicle_link.transport.heartbeat import LinkState

ALONE = Facts(link=LinkState.LOST, clock_known=False, telemetry_rate=0.0, loss=0.0, mode=None)
CONNECTED = replace(ALONE, link=LinkState.GOOD)
READY = replace(
    CONNECTED,
    mode="ready",
    telemetry_rate=100.0,
    tick_rate=500.0,
    tracker_rate=100.0,
    bearings_rate=30.0,
)


class Station:
    """The start-up checks of a station; `live` lets them run for some seconds."""

    def __init__(self, data: Path) -> None:
        (data / "runs").mkdir()
        self._now, self._second = ALONE, 0
        self.checked: list[int] = []
        """The second of each check that was made."""
        self.said: list[str] = []
        context: Any = SimpleNamespace(
            node=SimpleNamespace(client=lambda *_: self, serve=lambda *_: None),
            outbox=SimpleNamespace(say=lambda _, text: self.said.append(text)),
            parameters=station_parameters(),
        )
        gatherer: Any = SimpleNamespace(facts=lambda: self._now, link_status=None)
        self._checks = StartupChecks(context, data, gatherer)

    def ask(self, *_: Any, **__: Any) -> Any:
        """Make the vehicle's own checks, as its client. Raises LinkError without a vehicle."""
        self.checked.append(self._second)
        if self._now.link is LinkState.LOST:
            raise LinkError("no vehicle")
        return SimpleNamespace(checks=to_messages([Check("firmware", "ok", "1", place="vehicle")]))

    def live(self, facts: Sequence[Facts]) -> None:
        """Find these facts, one a second."""
        for self._now in facts:
            self._second += 1
            self._checks.tick()

    @property
    def attention(self) -> set[str]:
        return {one.name for one in self._checks.found if one.state in ("warn", "fail")}


RATES = {"telemetry", "flight loop", "tracker", "bearings"}


@pytest.fixture
def station(tmp_path: Path) -> Station:
    return Station(tmp_path)


def test_a_vehicle_that_compiles_before_it_measures_is_checked_once_it_measures(
    station: Station,
) -> None:
    compiling = 2 * WITHOUT_VEHICLE
    station.live([ALONE, *[CONNECTED] * compiling])
    assert station.checked == []
    station.live([READY] * 3 * WITHOUT_VEHICLE)
    assert station.checked == [1 + compiling + SETTLE]
    assert not station.attention & RATES


def test_without_a_vehicle_the_station_is_checked_and_again_once_one_measures(
    station: Station,
) -> None:
    station.live([ALONE] * 2 * WITHOUT_VEHICLE)
    assert station.checked == [WITHOUT_VEHICLE]
    assert {"tracker", "bearings"} <= station.attention
    station.live([*[CONNECTED] * WITHOUT_VEHICLE, *[READY] * WITHOUT_VEHICLE])
    assert station.checked == [WITHOUT_VEHICLE, 3 * WITHOUT_VEHICLE + SETTLE]
    assert not station.attention & RATES


def test_a_tracker_that_starts_after_the_vehicle_is_waited_for_a_while(station: Station) -> None:
    untracked = replace(READY, tracker_rate=0.0, bearings_rate=0.0)
    station.live([*[untracked] * SETTLE, *[READY] * 2 * WITHOUT_VEHICLE])
    assert station.checked == [2 * SETTLE]
    assert not station.attention & RATES


def test_without_a_tracker_the_vehicle_is_checked_all_the_same(station: Station) -> None:
    station.live([replace(READY, tracker_rate=0.0)] * 2 * WITHOUT_TRACKER)
    assert station.checked == [WITHOUT_TRACKER]
    assert "tracker" in station.attention


def test_a_vehicle_that_never_measures_is_checked_at_last(station: Station) -> None:
    station.live([CONNECTED] * 2 * WITHOUT_STATUS)
    assert station.checked == [WITHOUT_STATUS]
    assert {"tracker", "bearings"} <= station.attention


@pytest.mark.parametrize(
    ("rate", "loss", "least", "state"),
    [
        (33.0, 0.0, 20.0, "ok"),  # one of two vehicles of `quadlab up`
        (100.0, 0.0, 50.0, "ok"),
        (80.0, 0.2, 50.0, "warn"),
        (40.0, 0.6, 50.0, "fail"),
        (24.0, 0.0, 50.0, "fail"),
    ],
)
def test_telemetry_is_judged_by_what_the_vehicle_sends(
    rate: float, loss: float, least: float, state: str
) -> None:
    parameters = station_parameters()
    parameters.preflight.telemetry_rate_min = least
    found = rates(replace(READY, telemetry_rate=rate, loss=loss, nominal_rate=100.0), parameters)
    assert {one.name: one.state for one in found}["telemetry"] == state


def test_what_needed_attention_and_no_longer_does_is_reported_once(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    def tracker(checks: Any) -> list[Check]:
        rate = checks._gatherer.facts().tracker_rate
        return [Check("tracker", "ok" if rate else "fail", f"{rate:g} Hz")]

    monkeypatch.setattr(StartupChecks, "_check_station", tracker)
    station.live([*[ALONE] * WITHOUT_VEHICLE, *[READY] * WITHOUT_VEHICLE])
    assert station.said == [
        "start-up checks need attention: tracker (station); see the Settings page",
        "start-up checks: nothing needs attention any more",
    ]
