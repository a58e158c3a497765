"""Pre-flight check list, judged from facts alone: each line can fail, and gives advice."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from console.checks.facts import Facts
from console.checks.items import ITEMS, judged, reasons
from console.parameters.preflight import PreflightParameters
from vehicle_link.transport.heartbeat import LinkState

LIMITS = PreflightParameters()
GOOD = Facts(
    link=LinkState.GOOD,
    clock_known=True,
    telemetry_rate=100.0,
    loss=0.0,
    mode="ready",
    tick_rate=500.0,
    position_innovation=0.002,
    attitude_innovation=0.01,
    pose_age=0.005,
    tracker_rate=100.0,
    bearings_rate=30.0,
    voltage=16.0,
    battery_warning=13.8,
    position_w=(0.0, 0.0, 0.0),
    tilt=0.01,
    speed=0.0,
    body_rate=0.01,
    gravity_off=0.02,
    volume=((-3.0, 3.0), (-3.0, 3.0), (0.2, 3.0)),
    parameters_behind=0.0,
    free_bytes=50e9,
    keep_free=5e8,
)
FAILING: list[tuple[str, dict[str, Any], str]] = [
    ("link", {"link": LinkState.DEGRADED}, "degraded"),
    ("link", {"link": LinkState.LOST}, "lost"),
    ("vehicle's clock", {"clock_known": False}, "not known"),
    ("telemetry", {"telemetry_rate": 40.0}, "40 Hz"),
    ("mode", {"mode": "cut"}, "Disarm"),
    ("mode", {"mode": "emergency_land"}, "emergency land"),
    ("mode", {"mode": None}, "nothing received"),
    ("gyroscope", {"flags": frozenset({"gyro_uncalibrated"})}, "still"),
    ("estimator", {"position_innovation": 0.3}, "300 mm"),
    ("estimator", {"attitude_innovation": math.radians(8.0)}, "8.0°"),
    ("estimator", {"position_innovation": None}, "nothing received"),
    ("consistency", {"consistency": 4.2, "refused_share": 0.0}, "4.2, 0 % refused"),
    ("consistency", {"consistency": 1.0, "refused_share": 0.7}, "70 % refused"),
    ("measurements", {"tracker_rate": 30.0}, "tracker at 30 Hz"),
    ("measurements", {"pose_age": 0.4}, "400 ms"),
    ("measurements", {"pose_age": math.inf}, "no pose yet"),
    ("measurements", {"flags": frozenset({"no_pose"})}, "the tracker and the link"),
    ("battery", {"voltage": 13.9}, "13.9 V, required: at least 14.0 V"),
    ("battery", {"voltage": 14.2, "battery_warning": 14.5}, "at least 14.5 V"),
    ("battery", {"flags": frozenset({"battery_low"})}, "charge"),
    ("battery", {"voltage": None}, "nothing received"),
    ("battery", {"voltage": math.nan}, "nan V"),
    ("level and still", {"tilt": math.radians(12.0)}, "12.0°"),
    ("level and still", {"speed": 0.3}, "0.30 m/s"),
    ("level and still", {"body_rate": math.radians(20.0)}, "20.0°/s"),
    ("level and still", {"airborne": True}, "in the air"),
    ("tracked body", {"gravity_off": math.radians(90.0)}, "90° off"),
    ("tracked body", {"gravity_off": math.pi}, "180° off"),
    ("tracked body", {"body_turn": math.radians(90.0)}, "turned by +90° about the vertical"),
    ("flight volume", {"position_w": (3.5, 0.0, 0.0)}, "3.50"),
    ("flight volume", {"position_w": (0.0, -4.0, 0.0)}, "-4.00"),
    ("flight volume", {"position_w": (0.0, 0.0, 3.2)}, "3.20"),
    ("flight volume", {"volume": None}, "nothing received"),
    ("parameters", {"parameters_behind": None}, "not read yet"),
    ("parameters", {"parameters_behind": 3.0}, "3 s behind"),
    ("recording", {"free_bytes": 1e8, "keep_free": 5e8}, "100 MB free, required: at least 500 MB"),
    (
        "recording",
        {"folder_problem": ("it is missing", "mount its disk")},
        "missing, required: a folder",
    ),
    ("alarms", {"alarms": ("status: bytes are no status",)}, "bytes are no status"),
    ("sticks", {"deflection": 0.4}, "deflected by 40 %"),
    ("sticks", {"deflection": math.nan}, "deflected"),
    ("sticks", {"sticks_dropped": True}, "release the dead-man"),
]
WARNING: list[tuple[str, dict[str, Any]]] = [
    ("consistency", {"flags": frozenset({"rescued"})}),
    ("telemetry", {"loss": 0.2}),
    ("alarms", {"notices": ("the catalogue cannot be used",)}),
    ("flight loop", {"flags": frozenset({"not_real_time"})}),
    ("flight loop", {"missed_share": 0.05}),
]


def states(facts: Facts) -> dict[str, str]:
    return {one.name: one.state for one in judged(facts, LIMITS)}


def test_a_vehicle_that_stands_ready_is_ready() -> None:
    assert set(states(GOOD).values()) == {"ok"}
    assert reasons(judged(GOOD, LIMITS)) == []


@pytest.mark.parametrize(("name", "change", "said"), FAILING)
def test_each_line_fails_alone_and_says_why(name: str, change: dict[str, Any], said: str) -> None:
    facts = replace(GOOD, **change)
    failing = {one for one, state in states(facts).items() if state == "fail"}
    assert failing == {name}
    [reason] = reasons(judged(facts, LIMITS))
    assert reason.startswith(f"{name}: ")
    assert said in reason
    check = next(one for one in judged(facts, LIMITS) if one.name == name)
    assert check.advice
    assert check.wanted


@pytest.mark.parametrize(("name", "change"), WARNING)
def test_what_is_worth_a_word_only_keeps_nobody_on_the_ground(
    name: str, change: dict[str, Any]
) -> None:
    facts = replace(GOOD, **change)
    assert {one: state for one, state in states(facts).items() if state != "ok"} == {name: "warn"}
    assert reasons(judged(facts, LIMITS)) == []


def test_every_line_has_a_fact_that_makes_it_fail_or_warn() -> None:
    names = {item(GOOD, LIMITS).name for item in ITEMS}
    assert names == {name for name, *_ in (*FAILING, *WARNING)}


def test_standing_below_the_floor_of_the_volume_is_standing_on_the_ground() -> None:
    assert states(replace(GOOD, position_w=(0.0, 0.0, -0.05)))["flight volume"] == "ok"


def test_of_a_vehicle_without_a_link_only_the_link_is_said() -> None:
    nothing = Facts(
        link=LinkState.LOST,
        clock_known=True,
        telemetry_rate=0.0,
        loss=0.0,
        mode=None,
        tracker_rate=100.0,
        parameters_behind=0.0,
        free_bytes=50e9,
    )
    assert [one.split(":")[0] for one in reasons(judged(nothing, LIMITS))] == ["link"]
    assert states(nothing)["battery"] == "unknown"


def test_limits_are_parameters() -> None:
    strict = PreflightParameters(battery_min=16.5, stick_deflection_max=0.0)
    failing = {
        one.name for one in judged(replace(GOOD, deflection=0.01), strict) if one.state == "fail"
    }
    assert failing == {"battery", "sticks"}
