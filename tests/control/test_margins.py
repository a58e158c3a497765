"""Margins agree with the closed loop that they describe, and presets have their stated ones."""

from __future__ import annotations

from collections import deque
from math import factorial

import numpy as np
import pytest

from control.disturbance_observer import DisturbanceObserver
from control.margins import LOW_MARGIN, Margin, margins, smallest
from control.parameters import ControlParameters
from control.presets import PRESETS, preset
from control.trajectories.line import Hover
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from tests.control.flight import Flight

LAG = 0.047


def of(parameters: ControlParameters, loop: str) -> Margin:
    return next(one for one in margins(parameters, LAG) if one.loop == loop)


def test_the_default_gains_have_31_degrees_and_exact_rates_75() -> None:
    assert of(preset("standard"), "position").phase == pytest.approx(31.0, abs=1.0)
    assert 73.0 < of(preset("damped"), "position").phase < 79.0


def test_the_margin_is_the_phase_where_the_loop_gain_is_one() -> None:
    p = preset("stiff")
    found = of(p, "height")
    s = 1j * found.crossover
    g = p.position
    loop = (g.kp_z + g.kv_z * s + g.ki_z / s) / (s**2 * (LAG * s + 1))
    assert abs(loop) == pytest.approx(1.0, abs=2e-3)
    assert found.phase == pytest.approx(180.0 + np.degrees(np.angle(loop)), abs=0.3)


def test_without_lag_and_integral_yaw_is_a_double_integrator_with_pd() -> None:
    p = ControlParameters().model_copy(deep=True)
    p.attitude.ki_z = 0.0
    found = next(one for one in margins(p, 1e-9) if one.loop == "yaw")
    w = found.crossover
    assert found.phase == pytest.approx(
        np.degrees(np.arctan(p.attitude.kw_z * w / p.attitude.kr_z)), abs=0.3
    )
    assert found.delay == pytest.approx(np.radians(found.phase) / w)


def test_gains_without_margin_oscillate_in_the_loop_and_those_with_it_do_not() -> None:
    bad = ControlParameters().model_copy(deep=True)
    bad.position.kp_xy, bad.position.kv_xy = 9.0, 5.0
    bad.attitude.kr_xy, bad.attitude.kw_xy = 30.0, 7.5
    assert smallest(margins(bad, LAG)).phase < 5.0
    last = {}
    for name, parameters in (("bad", bad), ("stiff", preset("stiff"))):
        f = Flight(parameters=parameters)
        errors = f.fly(Hover((0.05, 0.0, 0.0), 0.0), 8.0)
        last[name] = np.abs(errors[-1000:, 0]).max()
    print(last)
    assert last["bad"] > 0.05
    assert last["stiff"] < 0.005


@pytest.mark.parametrize(("share", "stable"), [(0.9, True), (1.1, False)])
def test_the_delay_is_what_the_height_loop_bears(share: float, stable: bool) -> None:
    g = preset("standard").position
    delay = share * of(preset("standard"), "height").delay
    from scipy.interpolate import pade

    top, bottom = pade([(-delay) ** k / factorial(k) for k in range(9)], 4)
    s = np.poly1d([1.0, 0.0])
    loop = (g.kv_z * s * s + g.kp_z * s + g.ki_z) * top
    closed = loop + s**3 * (LAG * s + 1) * bottom
    assert (closed.roots.real.max() < 0.0) == stable


def test_exact_rates_take_the_acceleration_from_the_attitude() -> None:
    found = of(preset("damped"), "estimate")
    assert found.phase == pytest.approx(46.0, abs=0.5)
    assert found.delay == pytest.approx(0.316, abs=0.002)


def hovering(parameters: ControlParameters, delay: float) -> tuple[float, float]:
    """Return the largest error in the middle and in the last third of 30 s that begin 1 cm beside
    the reference, with position and velocity sideways measured late (s).
    """
    f, dt = Flight(parameters=parameters), 0.002
    law, late = f.controller.step, deque[Record](maxlen=round(delay / dt) + 1)
    observer, model = DisturbanceObserver(parameters.disturbance), f.believed.record()

    def step(
        state: Record, reference: Record, airborne: bool, dt: float, actuators: Record
    ) -> None:
        late.append(state.copy())
        seen = state.copy()
        for name in ("position_w", "velocity_w"):
            seen[name][:, :2] = late[0][name][:, :2]
        if not observer.idle:
            observer.step(seen, actuators, model, True, False, dt, f.controller.disturbance)
        law(seen, reference, airborne, dt, actuators)

    f.controller.step = step  # type: ignore[method-assign]
    f.x[0] = 0.01
    _, middle, last = np.split(np.abs(f.fly(Hover((0.0, 0.0, 0.0), 0.0), 30.0, dt)[:, 0]), 3)
    return float(middle.max()), float(last.max())


@pytest.mark.parametrize(
    ("name", "within"), [("standard", 0.03), ("damped", 0.03), ("observer", 0.05)]
)
def test_the_delay_of_the_measured_motion_is_what_the_flying_law_bears(
    name: str, within: float
) -> None:
    """The observer's filters of a tick bear 3 % more than those of the linear model."""
    parameters = preset(name)
    delay = of(parameters, "estimate").delay
    middle, last = hovering(parameters, (1 - within) * delay)
    assert last < middle
    middle, last = hovering(parameters, (1 + within) * delay)
    assert last > middle


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_within_bounds_and_fit_to_fly(name: str) -> None:
    parameters = preset(name)
    store = ParameterStore(ControlParameters().model_copy(deep=True))
    for path, value in PRESETS[name].items():
        store.check(path, value)
    assert smallest(margins(parameters, LAG)).phase > LOW_MARGIN


def test_presets_share_nothing_with_the_defaults() -> None:
    preset("stiff").position.kp_xy = 1.0
    assert preset("stiff").position.kp_xy == 6.0
    assert ControlParameters().position.kp_xy == 4.0


def test_an_unknown_preset_names_those_there_are() -> None:
    with pytest.raises(OutOfBoundsError, match=r"'sporty'.*standard, stiff"):
        preset("sporty")
