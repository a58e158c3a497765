"""One layout of beacons for station and vehicle."""

from __future__ import annotations

from typing import Any

import pytest

from console.beacon_layout import AGAIN, STATION_LAYOUT, VEHICLE_LAYOUT, BeaconLayout
from console.parameters.store import StationStore
from quadrotor.errors import LinkError, OutOfBoundsError, ParameterError
from quadrotor.parameter_description import ParameterValue


class Vehicle:
    """A vehicle's parameters as the station has them, and its answers."""

    def __init__(self, layout: str | None = "paper") -> None:
        self.layout: ParameterValue | None = layout
        self.refusal: Exception | None = None
        self.told: list[tuple[str, str]] = []
        self.connected = True
        self.now = 0.0

    def known(self, name: str) -> ParameterValue | None:
        assert name == VEHICLE_LAYOUT
        return self.layout

    def set_layout(self, text: str, requester: str) -> None:
        self.told.append((text, requester))
        if self.refusal is not None:
            raise self.refusal
        self.layout = text


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle()


@pytest.fixture
def store() -> StationStore:
    return StationStore()


@pytest.fixture
def layout(store: StationStore, vehicle: Vehicle) -> BeaconLayout:
    made = BeaconLayout(
        lambda: store.parameters.bearings.layout,
        vehicle.known,
        lambda: vehicle.connected,
        vehicle.set_layout,
        lambda: vehicle.now,
    )
    store.consult(made.before_change)
    return made


@pytest.mark.usefixtures("layout")
def test_a_new_layout_is_the_vehicles_before_it_is_the_stations(
    store: StationStore, vehicle: Vehicle
) -> None:
    changes: list[Any] = []
    store.subscribe(lambda *change: changes.append((*change[:4], vehicle.layout)))
    store.change({STATION_LAYOUT: "eight"}, "ada")
    assert vehicle.told == [("eight", "ada")]
    assert changes == [(STATION_LAYOUT, "paper", "eight", "ada", "eight")]


@pytest.mark.usefixtures("layout")
def test_other_parameters_do_not_ask_the_vehicle(store: StationStore, vehicle: Vehicle) -> None:
    store.change({"station.bearings.sigma": 2.0, STATION_LAYOUT: "paper"}, "ada")
    assert vehicle.told == []
    assert store.parameters.bearings.sigma == 2.0


@pytest.mark.usefixtures("layout")
@pytest.mark.parametrize(
    ("refusal", "says"),
    [
        (ParameterError("bearings are flown on"), "refused by the vehicle: bearings are flown on"),
        (LinkError("1 s"), "layout not changed: 1 s; try again"),
    ],
)
def test_what_the_vehicle_refuses_the_station_refuses(
    store: StationStore, vehicle: Vehicle, refusal: Exception, says: str
) -> None:
    vehicle.refusal = refusal
    before, revision = store.values(), store.revision
    with pytest.raises(ParameterError, match=says):
        store.change({"station.bearings.sigma": 3.0, STATION_LAYOUT: "eight"}, "ada")
    assert (store.values(), store.revision) == (before, revision)


@pytest.mark.usefixtures("layout")
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1 0 0 0; 2 1 0 0; 3 2 0 0", "3 beacons; allowed are 4 to 32"),
        ("1 0 0 0; 2 1 0 0; 3 2 0 0; 4 3 0 0", "one line"),
        ("none", "neither a preset"),
    ],
)
def test_a_bad_layout_never_reaches_the_vehicle_and_changes_nothing(
    store: StationStore, vehicle: Vehicle, text: str, says: str
) -> None:
    before, values = store.values(), {"station.bearings.sigma": 3.0, STATION_LAYOUT: text}
    for refused in (lambda: store.change(values, "ada"), lambda: store.tried(values)):
        with pytest.raises(OutOfBoundsError, match=says):
            refused()
    assert (store.values(), store.revision, vehicle.told) == (before, 0, [])


def test_a_bad_layout_is_refused_at_the_start() -> None:
    with pytest.raises(OutOfBoundsError, match="neither a preset"):
        StationStore().preset({STATION_LAYOUT: "papier"})


def test_without_a_link_the_station_changes_alone_and_tells_the_vehicle_later(
    store: StationStore, vehicle: Vehicle, layout: BeaconLayout
) -> None:
    vehicle.connected = False
    store.change({STATION_LAYOUT: "wall"}, "ada")
    assert vehicle.told == []
    vehicle.connected = True
    assert layout.agree() == ""
    assert vehicle.told == [("wall", "station")]
    assert layout.agree() == ""
    assert len(vehicle.told) == 1


@pytest.mark.parametrize("theirs", [None, "paper"])
def test_a_vehicle_that_agrees_or_has_no_beacons_is_left_alone(
    vehicle: Vehicle, layout: BeaconLayout, theirs: str | None
) -> None:
    vehicle.layout = theirs
    assert layout.agree() == ""
    assert vehicle.told == []


def test_a_vehicle_that_refuses_is_an_alarm_and_asked_again_later(
    vehicle: Vehicle, layout: BeaconLayout
) -> None:
    vehicle.layout, vehicle.refusal = "wall", ParameterError("bearings are flown on")
    reason = layout.agree()
    assert reason == "the vehicle has other beacons (wall): bearings are flown on"
    vehicle.now = AGAIN - 0.1
    assert layout.agree() == reason
    assert len(vehicle.told) == 1
    vehicle.now, vehicle.refusal = AGAIN + 0.1, None
    assert layout.agree() == ""
    assert vehicle.told[1:] == [("paper", "station")]


def test_no_answer_is_the_links_matter(vehicle: Vehicle, layout: BeaconLayout) -> None:
    vehicle.layout, vehicle.refusal = "wall", LinkError("gone")
    with pytest.raises(LinkError):
        layout.agree()
    vehicle.refusal = None
    assert layout.agree() == ""
