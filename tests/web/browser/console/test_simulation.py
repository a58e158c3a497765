"""A simulated vehicle is marked, and accepts a full battery and a restart; a real one does not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from quadrotor.parameters import Parameters, ParameterStore
from vehicle.simulator.parameters import SimulatorParameters

STANDS = {"mode": "ready", "armed": False, "airborne": False, "behavior": "ground"}


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


def asked(station: Any) -> list[str]:
    return [request.action for name, request in station.requests if name == "simulation"]


def test_a_battery_is_swapped_by_a_press_and_the_vehicle_reset_by_a_hold(
    simulated: Any, page: Any, look: Any
) -> None:
    page.keyboard.press("Escape")  # the help of a first visit
    look.text("#simulation .badge", "^SIMULATION$")
    page.click("#simulation summary")
    page.click("#swap-battery")
    look.text("#answer", "^swap battery: accepted")
    page.click("#reset-vehicle")  # not held: no effect
    look.hold("#reset-vehicle", lambda: len(asked(simulated)) == 2)
    assert asked(simulated) == ["swap_battery", "reset"]
    simulated.said = {}
    look.text("#doing", "^FLYING")
    page.wait_for_selector("#swap-battery:disabled")
    assert page.is_disabled("#reset-vehicle")
    assert "motors off" in page.get_attribute("#swap-battery", "title")


def test_a_real_vehicle_has_no_such_buttons(page: Any, look: Any) -> None:
    look.text("#doing", "^FLYING")
    page.wait_for_selector("#gains details", state="attached")
    # The page recognises another vehicle only after two checks.
    page.wait_for_selector("#simulation", state="hidden")
