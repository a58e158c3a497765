"""The 3D view shows the beacons that the confirmed parameters describe."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from bearing_sim.beacons import PRESETS, Beacons
from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.observability import FieldOfView
from web.parameters.follower import BEARINGS, ParameterFollower
from web.parameters.replica import PageParameters


class Shown:
    """The part of a scene's beacons that the follower uses."""

    def __init__(self) -> None:
        self.calls: list[tuple[Beacons, float, FieldOfView, float]] = []

    def set_beacons(self, *given: Any) -> None:
        self.calls.append(given)


@pytest.fixture
def replica() -> PageParameters:
    return PageParameters(lambda _: None)


@pytest.fixture
def shown() -> Shown:
    return Shown()


@pytest.fixture
def follower(replica: PageParameters, shown: Shown) -> ParameterFollower:
    scene = SimpleNamespace(beacons=shown)
    nothing: Any = None
    return ParameterFollower(replica, nothing, nothing, scene, "/quad1")  # type: ignore[arg-type]


def confirm(replica: PageParameters, **values: Any) -> None:
    replica.confirm({f"{BEARINGS}{name}": value for name, value in values.items()}, "operator 1", 1)


def test_nothing_is_shown_before_the_station_has_told(
    follower: ParameterFollower, replica: PageParameters, shown: Shown
) -> None:
    follower.show_beacons()
    replica.confirm({"control.position.kp_xy": 4.0}, "operator 1", 1)
    follower.show_beacons()
    assert shown.calls == []


def test_each_confirmed_change_is_shown_once(
    follower: ParameterFollower, replica: PageParameters, shown: Shown
) -> None:
    confirm(replica, **BearingParameters().model_dump())
    for _ in range(3):
        follower.show_beacons()
    [(beacons, sigma, sight, rate)] = shown.calls
    assert beacons == PRESETS["paper"]
    assert sigma == pytest.approx(math.radians(1.5))
    assert rate == 30.0
    assert sight == FieldOfView.of(BearingParameters())

    confirm(replica, layout="eight", sigma=2.0, field_of_view=90.0, mount_pitch=10.0, lost="3")
    follower.show_beacons()
    beacons, sigma, sight, _ = shown.calls[1]
    assert beacons == PRESETS["eight"]
    assert sigma == pytest.approx(math.radians(2.0))
    assert sight.half_angle == pytest.approx(math.radians(45.0))
    assert sight.lost == frozenset({3})
    assert sight.axis_b[0] < 0.0


def test_what_cannot_be_read_changes_nothing(
    follower: ParameterFollower, replica: PageParameters, shown: Shown
) -> None:
    confirm(replica, layout="paper", sigma=1.5)
    follower.show_beacons()
    for layout in ("1 0 0 0; 2 1 0 0; 3 2 0 0; 4 3 0 0", "a circle", 3):
        confirm(replica, layout=layout)
        follower.show_beacons()
    assert len(shown.calls) == 1
    confirm(replica, layout="wide")
    follower.show_beacons()
    assert shown.calls[1][0] == PRESETS["wide"]
