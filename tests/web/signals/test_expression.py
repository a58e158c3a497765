"""A derived signal is what its expression says, live sample by sample as in a log at once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from quadrotor.errors import OutOfBoundsError
from web.signals.expression import LONGEST, is_expression, parse
from web.signals.functions import FUNCTIONS

UNITS = {
    "state.position.x": "m",
    "state.velocity.x": "m/s",
    "state.velocity.y": "m/s",
    "state.yaw": "°",
    "actuators/thrusts[0]": "",
    "actuators": "",
}
TIMES: Any = np.arange(400) * 0.01


@pytest.fixture
def columns() -> dict[str, Any]:
    random = np.random.default_rng(6)
    return {name: random.normal(size=len(TIMES)) for name in UNITS}


def value(text: str, columns: dict[str, Any]) -> Any:
    return parse(text, UNITS).start()(TIMES, columns)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2 * state.yaw - 1", lambda c: 2 * c["state.yaw"]),
        ("-state.yaw^2", lambda c: -(c["state.yaw"] ** 2)),
        ("2^-1*state.yaw", lambda c: 0.5 * c["state.yaw"]),
        ("state.yaw-1-1", lambda c: c["state.yaw"] - 2),
        ("8/4/state.yaw", lambda c: 2 / c["state.yaw"]),
        ("(state.yaw + 1.5e1) * pi", lambda c: (c["state.yaw"] + 15) * math.pi),
        ("norm(state.yaw, 2)", lambda c: np.hypot(c["state.yaw"], 2)),
        ("max(state.yaw, 0) + min(state.yaw, 0)", lambda c: c["state.yaw"]),
        ("sqrt(abs(state.yaw))", lambda c: np.sqrt(np.abs(c["state.yaw"]))),
        ("sin(rad(state.yaw))", lambda c: np.sin(np.radians(c["state.yaw"]))),
        ("actuators/thrusts[0]/state.yaw", lambda c: c["actuators/thrusts[0]"] / c["state.yaw"]),
        ("actuators/state.yaw", lambda c: c["actuators"] / c["state.yaw"]),
    ],
)
def test_it_follows_the_rules_of_arithmetic(
    text: str, expected: Any, columns: dict[str, Any]
) -> None:
    np.testing.assert_allclose(value(text, columns), expected(columns))


@pytest.mark.parametrize(
    "text",
    [
        "diff(state.yaw)",
        "integral(state.yaw)",
        "lowpass(state.yaw, 3)",
        "diff(lowpass(state.yaw, 2))",
    ],
)
def test_sample_by_sample_it_has_the_values_that_it_has_at_once(
    text: str, columns: dict[str, Any]
) -> None:
    whole, step = value(text, columns), parse(text, UNITS).start()
    single = [
        step(TIMES[k : k + 1], {name: one[k : k + 1] for name, one in columns.items()})[0]
        for k in range(len(TIMES))
    ]
    np.testing.assert_allclose(single, whole)


def test_the_integral_of_the_rate_is_the_signal(columns: dict[str, Any]) -> None:
    columns["state.yaw"] = np.sin(TIMES)
    back = value("integral(diff(state.yaw))", columns)
    np.testing.assert_allclose(back, np.sin(TIMES), atol=0.011)


def test_a_low_pass_filter_passes_what_is_slow_and_halves_the_power_at_its_cut_off(
    columns: dict[str, Any],
) -> None:
    times: Any = np.arange(20_000) * 1e-3
    for frequency, gain in ((0.02, 1.0), (2.0, math.sqrt(0.5)), (40.0, 0.05)):
        wave = np.sin(2 * math.pi * frequency * times)
        passed = parse("lowpass(state.yaw, 2)", UNITS).start()(times, {"state.yaw": wave})
        assert np.abs(passed[10_000:]).max() == pytest.approx(gain * np.abs(wave).max(), rel=0.03)


def test_a_gap_stays_one_and_what_follows_is_not_lost(columns: dict[str, Any]) -> None:
    columns["state.yaw"][100:110] = np.nan
    for text, last in (("diff", 111), ("lowpass", 110), ("integral", 0)):
        found = value(f"{text}(state.yaw{', 2' if text == 'lowpass' else ''})", columns)
        assert np.isfinite(found[last + 1 :]).all()
        assert text == "integral" or np.isnan(found[100:110]).all()


@pytest.mark.parametrize(
    ("text", "name", "label", "unit"),
    [
        ("abs(state.velocity.x)", "= abs(state.velocity.x)", "abs(state.velocity.x)", "m/s"),
        ("speed = 2*state.velocity.x", "speed = 2*state.velocity.x", "speed", "m/s"),
        (
            "speed [km/h] = 3.6*state.velocity.x",
            "speed [km/h] = 3.6*state.velocity.x",
            "speed",
            "km/h",
        ),
        (
            "=diff(state.position.x)+1",
            "= diff(state.position.x)+1",
            "diff(state.position.x)+1",
            "m/s",
        ),
        (
            "integral(state.velocity.x)",
            "= integral(state.velocity.x)",
            "integral(state.velocity.x)",
            "m",
        ),
        (
            "state.velocity.x*state.yaw",
            "= state.velocity.x*state.yaw",
            "state.velocity.x*state.yaw",
            "",
        ),
        ("1/state.yaw", "= 1/state.yaw", "1/state.yaw", ""),
        ("[] = state.yaw", "[] = state.yaw", "state.yaw", ""),
    ],
)
def test_its_name_says_it_again_and_its_unit_follows(
    text: str, name: str, label: str, unit: str
) -> None:
    found = parse(text, UNITS)
    assert (found.name, found.label, found.unit) == (name, label, unit)
    assert is_expression(found.name)
    again = parse(found.name, UNITS)
    assert (again.name, again.label, again.unit) == (name, label, unit)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "expected a signal.*not the end"),
        ("1 + 2", "no signal in it"),
        ("state.yaw +", "character 12: .*the end"),
        ("state.yaw state.yaw", "character 11: expected an operator, not 's'"),
        ("(state.yaw", r"expected '\)'"),
        ("state.yow", "did you mean state.yaw"),
        ("eval(state.yaw)", "no function eval; there are abs"),
        ("__import__('os')", "no function __import__"),
        ("diff(state.yaw, 2)", "diff takes 1 arguments, not 2"),
        ("lowpass(state.yaw, 0)", "lowpass needs its cut-off"),
        ("lowpass(state.yaw, state.yaw)", "lowpass needs its cut-off"),
        ("a = b = state.yaw", "no signal b"),
        ("(" * 100 + "state.yaw", "more than 40"),
        ("-" * 100 + "state.yaw", "more than 40"),
        ("x" * (LONGEST + 1), "at most 300"),
        ("state.yaw\n; 1", "expected an operator, not ';'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(text: str, says: str) -> None:
    with pytest.raises(OutOfBoundsError, match=says) as caught:
        parse(text, UNITS)
    assert "\n" not in str(caught.value)


def test_a_constant_that_overflows_is_no_error(columns: dict[str, Any]) -> None:
    assert np.isinf(value("state.yaw*0 + 9^9^9^9", columns)).all()


def test_every_function_can_be_called(columns: dict[str, Any]) -> None:
    for name, (least, _, _) in FUNCTIONS.items():
        others = ["2"] * (least - 1)
        found = value(f"{name}({', '.join(['state.yaw', *others])})", columns)
        assert found.shape == TIMES.shape
