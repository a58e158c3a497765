"""Wind and faults on the page: set with a schedule, listed, stopped, and all taken back at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from quadrotor.parameters import Parameters, ParameterStore
from vehicle.simulator.parameters import SimulatorParameters

STANDS = {"mode": "ready", "armed": False, "airborne": False, "behavior": "ground"}
PANEL = "#faults"
SET = f"{PANEL} ul"


class _Root(Parameters):
    simulator: SimulatorParameters = SimulatorParameters()


@pytest.fixture
def simulated(station: Any) -> Iterator[Any]:
    """Yield the site's station, with its vehicle simulated and on the ground."""
    before = station.store
    station.store = ParameterStore(_Root().model_copy(deep=True))
    station.instance += 1  # another vehicle, whose parameters are read anew
    station.said = STANDS
    yield station
    station.store = before
    station.instance += 1


def open_panel(page: Any, look: Any) -> None:
    look.text("#simulation .badge", "^SIMULATION$")
    page.click("#simulation summary")
    page.click("#open-faults")
    page.wait_for_selector(f"{PANEL} option", state="attached")
    page.click(f"{PANEL} details summary")  # the schedule


def test_a_fault_is_started_with_a_schedule_listed_and_stopped(
    simulated: Any, page: Any, look: Any
) -> None:
    open_panel(page, look)
    look.text(SET, "^None\\.$")
    look.text(f"{PANEL} output", "^no wind, no faults$")
    page.select_option(f"{PANEL} > select", "motors.fade")
    page.select_option(f"{PANEL} select[aria-label=motor]", "left")
    page.fill(f"{PANEL} input[aria-label=gain]", "0.9")
    page.fill(f"{PANEL} input[aria-label=from]", "5")
    page.fill(f"{PANEL} input[aria-label=ramp]", "2.5")
    page.click(f"{PANEL} button >> text=Start")
    look.text(SET, "motors.fademotor=left gain=0.9 from=5 ramp=2.5Stop")
    entry = "motors.fade motor=left gain=0.9 from=5 ramp=2.5"
    assert simulated.store.get("simulator.faults") == entry
    page.select_option(f"{PANEL} > select", "barometer.stuck")
    page.fill(f"{PANEL} input[aria-label=from]", "0")
    page.fill(f"{PANEL} input[aria-label=ramp]", "0")
    page.click(f"{PANEL} button >> text=Start")
    look.text(f"{PANEL} output", "^2 faults set$")
    assert simulated.store.get("simulator.faults") == f"{entry}; barometer.stuck"
    page.click(f"{SET} li:nth-child(1) button")
    look.text(f"{PANEL} output", "^1 fault set$")
    assert simulated.store.get("simulator.faults") == "barometer.stuck"


def test_a_refusal_is_shown_and_changes_nothing(simulated: Any, page: Any, look: Any) -> None:
    open_panel(page, look)
    page.select_option(f"{PANEL} > select", "barometer.ramp")
    page.fill(f"{PANEL} input[aria-label=from]", "5")
    page.fill(f"{PANEL} input[aria-label=to]", "3")
    page.click(f"{PANEL} button >> text=Start")
    look.text(f"{PANEL} > .reason", "never begins: from = 5 s is not before its end at 3 s")
    look.text(SET, "^None\\.$")
    assert simulated.store.get("simulator.faults") == ""


def test_calm_and_aligned_takes_back_wind_load_and_faults(
    simulated: Any, page: Any, look: Any, until: Any
) -> None:
    store = simulated.store
    store.set({"simulator.faults": "imu.stuck", "simulator.wind_x": 3.0, "simulator.payload": 0.2})
    open_panel(page, look)
    look.text(SET, "imu.stuckonStop")
    look.value(f"{PANEL} .gain:has(input[aria-label='simulator.wind_x']) input.value", "3")
    page.click(f"{PANEL} button >> text=Remove all")
    look.text(f"{PANEL} output", "^no wind, no faults$")
    names = ("simulator.faults", "simulator.wind_x", "simulator.payload")
    assert [store.get(name) for name in names] == ["", 0.0, 0.0]


def test_a_tab_closes_the_panel(simulated: Any, page: Any, look: Any) -> None:
    open_panel(page, look)
    assert not page.is_hidden(PANEL)
    page.click("[data-tab=gains]")
    assert page.is_hidden(PANEL)


def test_a_real_vehicle_has_no_such_panel(page: Any, look: Any) -> None:
    look.text("#doing", "^FLYING")
    page.wait_for_selector("#gains details", state="attached")
    page.wait_for_selector("#simulation", state="hidden")
    assert page.is_hidden(PANEL)


def test_a_parameter_is_moved_by_a_schedule(simulated: Any, page: Any, look: Any) -> None:
    open_panel(page, look)
    page.select_option(f"{PANEL} > select", "simulator.payload")
    page.fill(f"{PANEL} input[aria-label=value]", "0.3")
    page.fill(f"{PANEL} input[aria-label=every]", "8")
    page.fill(f"{PANEL} input[aria-label=for]", "2")
    page.click(f"{PANEL} button >> text=Start")
    look.text(SET, "simulator.payloadvalue=0.3 for=2 every=8Stop")
    assert simulated.store.get("simulator.faults") == "simulator.payload value=0.3 for=2 every=8"
