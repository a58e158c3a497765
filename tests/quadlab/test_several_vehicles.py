"""Command lines of several vehicles: addresses, names, ports and folders."""

from __future__ import annotations

from pathlib import Path

import pytest

from console.link.known_vehicles import station_vehicles, write_station_vehicles
from quadlab.simulated.fleet import MAX_VEHICLES, SimulatedFleet
from quadlab.vehicle_names import parse_names, parse_vehicles
from quadrotor.errors import LinkError, UsageError
from vehicle.processes.config import FEWEST_PACKETS, PACKETS_A_SECOND
from vehicle.simulator.robot import pace_of
from vehicle_link.security.authority import check_certificate, ensure_certificates
from vehicle_link.telemetry import SAMPLES_A_PACKET

PERIOD = 0.001  # s, of the simulated microcontroller


def test_addresses_of_several_vehicles_are_read_with_their_names() -> None:
    words = ("quad1=10.0.0.2:7447", "quad2=10.0.0.3")
    assert parse_vehicles(words) == {"quad1": "10.0.0.2:7447", "quad2": "10.0.0.3"}
    assert parse_vehicles(("10.0.0.2:7447",), "lab") == {"lab": "10.0.0.2:7447"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("quad1=10.0.0.2", "quad1=10.0.0.3"), "two vehicles would be called 'quad1'"),
        (("10.0.0.2", "10.0.0.3"), "give each its own name"),
        (("quad1=10.0.0.2", "quad2=10.0.0.2:7447"), "quad1 and quad2 would both be the vehicle"),
        (("Quad 1=10.0.0.2",), "allowed are up to 32 lower-case letters"),
        (("quad1=",), "not the address of a vehicle"),
    ],
)
def test_addresses_that_cannot_be_meant_are_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(UsageError, match=said):
        parse_vehicles(words)


def test_a_name_is_given_once() -> None:
    assert parse_names(()) == ("quad1",)
    assert parse_names(("a", "b")) == ("a", "b")
    with pytest.raises(UsageError, match="--name a is given twice"):
        parse_names(("a", "a"))


@pytest.mark.parametrize("count", [0, 9])
def test_one_to_eight_vehicles_fly(count: int) -> None:
    with pytest.raises(UsageError, match="allowed are 1 to 8"):
        SimulatedFleet(count, "quad1", 7447).check()


def test_several_vehicles_have_their_own_names_and_ports() -> None:
    assert SimulatedFleet(1, "lab", 7447).ports == {"lab": 7447}
    several = SimulatedFleet(3, "quad1", 7447)
    assert several.ports == {"quad1": 7447, "quad2": 7449, "quad3": 7451}
    with pytest.raises(UsageError, match="leave out --name or --vehicles"):
        SimulatedFleet(3, "lab", 7447).check()


@pytest.mark.parametrize("count", range(1, MAX_VEHICLES + 1))
def test_the_rates_of_so_many_fit_together(count: int) -> None:
    fleet = SimulatedFleet(count, "quad1", 7447)
    rates, pace = fleet.rates, pace_of(count)
    assert FEWEST_PACKETS <= rates.packets <= PACKETS_A_SECOND
    assert rates.ticks <= rates.packets * SAMPLES_A_PACKET, "a packet holds all since the last"
    assert rates.bearings <= rates.poses <= pace.truth_rate, "each pose is of a truth of its own"
    assert pace.periods * PERIOD < 0.6 / rates.ticks, "the motors obey within the tick"


def test_a_vehicle_s_folder_has_its_certificate_and_cannot_issue_others(tmp_path: Path) -> None:
    files = ensure_certificates(tmp_path / "certificates", ["127.0.0.1"])
    folder = SimulatedFleet(2, "quad1", 7447).folder(tmp_path, "quad2", files)
    assert folder == tmp_path / "vehicles" / "quad2"
    copies = ensure_certificates(folder / "certificates")
    check_certificate(copies, "vehicle", "127.0.0.1")
    assert copies.authority.read_bytes() == files.authority.read_bytes()
    assert not copies.authority_key.exists()
    with pytest.raises(LinkError):
        check_certificate(copies, "station")


def test_one_vehicle_alone_keeps_the_data_folder(tmp_path: Path) -> None:
    files = ensure_certificates(tmp_path / "certificates")
    assert SimulatedFleet(1, "quad1", 7447).folder(tmp_path, "quad1", files) == tmp_path


def test_the_page_knows_whom_the_station_dialled_last(tmp_path: Path) -> None:
    assert station_vehicles(tmp_path) == ()
    write_station_vehicles(tmp_path, ["a", "b"])
    assert station_vehicles(tmp_path) == ("a", "b")
    (tmp_path / "station.json").write_text("torn {")
    assert station_vehicles(tmp_path) == ()
