"""Parts that extensions add to the station: a bad one ends alone."""

from __future__ import annotations

from typing import Any

import pytest

from console.parameters import station
from console.parameters.store import StationStore
from console.part import Part, Parts
from quadrotor.extension import Extension, StationPart
from quadrotor.extensions import Registry
from quadrotor.parameters import Parameters, parameter


class Wind(Parameters):
    speed: float = parameter(3.0, unit="m/s", ge=0, le=9, description="speed of the tunnel")


class Notes(Part):
    def __init__(self) -> None:
        self.taken: list[Any] = []

    def telemetry(self, payload: bytes) -> None:
        self.taken.append(payload)

    def close(self) -> None:
        self.taken.append("closed")


class Broken(Notes):
    def telemetry(self, payload: bytes) -> None:
        raise RuntimeError("no wind")


@pytest.fixture
def failures() -> list[tuple[str, str]]:
    return []


def test_a_part_that_raises_an_error_is_closed_and_told_once_and_the_others_go_on(
    failures: list[tuple[str, str]],
) -> None:
    broken, good = Broken(), Notes()
    parts = Parts({"wind": broken, "notes": good}, lambda *one: failures.append(one))
    for payload in (b"1", b"2"):
        parts.telemetry(payload)
    assert broken.taken == ["closed"]
    assert good.taken == [b"1", b"2"]
    ((name, line),) = failures
    assert name == "wind"
    assert "the part wind of the station ended: RuntimeError('no wind')" in line
    parts.close()
    assert good.taken[-1] == "closed"
    assert broken.taken == ["closed"]


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch) -> Registry:
    parts = (
        StationPart(
            name="wind", target=".none:make", parameters=f".{__name__.rpartition('.')[2]}:Wind"
        ),
        StationPart(name="lost", target=".none:make", parameters=".none:Lost"),
        StationPart(name="tracker", target=".none:make"),
    )
    declared = Extension(name="tunnel", summary="", protocol=1, offers=parts)
    registry = Registry([("tunnel", __name__.rpartition(".")[0], lambda: declared)])
    monkeypatch.setattr(station, "registry", lambda: registry)
    return registry


def test_parameters_of_a_part_are_below_its_name(offered: Registry) -> None:
    store, other = StationStore(), StationStore()
    store.change({"station.wind.speed": 4.0}, "ada")
    assert store.get("station.wind.speed") == 4.0
    assert other.get("station.wind.speed") == 3.0
    assert not [name for name in store.names if name.startswith("station.lost")]
    assert next(iter(offered.problems)).startswith(
        "extension tunnel: its part of the station tracker is left out, because quadlab itself has"
    )
