"""Features of the page: what a vehicle's context does not know is added and ended from outside."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import MagicMock

import pytest
from fastapi import FastAPI

from web.app import create_app
from web.beacons.survey import BeaconSurvey, add_survey
from web.feature import Feature
from web.features import panels_of_extensions
from web.static_files import files_with
from web.vehicle_context import VehicleContext


def addresses(app: FastAPI) -> set[str]:
    return {getattr(route, "path", "") for route in app.routes}


def test_a_feature_adds_its_routes_to_a_vehicle_with_that_vehicles_context() -> None:
    context, given = MagicMock(), list[Any]()

    def routes(app: FastAPI, of: VehicleContext) -> None:
        given.append(of)
        app.get("/api/extra")(lambda: "extra")

    app = create_app(context, MagicMock(), [Feature(routes)])
    assert given == [context]
    assert "/api/extra" in addresses(app)
    assert "/api/commands/arm" in addresses(app), "the routes of every page are there"
    assert "/api/runs" not in addresses(app), "a feature that was left out has no routes"


def test_a_service_of_one_vehicle_ends_with_its_context(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[BeaconSurvey] = []
    monkeypatch.setattr(BeaconSurvey, "stop", lambda one: ended.append(one))
    with contextlib.ExitStack() as closing:
        add_survey(FastAPI(), cast(VehicleContext, SimpleNamespace(closing=closing)), None)
        assert not ended
    assert len(ended) == 1


@pytest.mark.parametrize("path", ["/api/extra/x", "/api/extra", "/extra"])
def test_an_extensions_routes_are_below_its_name(path: str) -> None:
    def routes(app: FastAPI, _: VehicleContext) -> None:
        app.get(path)(lambda: "")

    app = create_app(MagicMock(), MagicMock(), [Feature(routes, name="extra")])
    assert path in addresses(app)


@pytest.mark.parametrize("path", ["/api/runs", "/api/extras", "/"])
def test_a_route_outside_an_extensions_name_leaves_the_feature_out_and_is_told(path: str) -> None:
    def routes(app: FastAPI, _: VehicleContext) -> None:
        app.get("/api/extra/first")(lambda: "")
        app.get(path)(lambda: "")

    context = MagicMock()
    app = create_app(context, MagicMock(), [Feature(routes, name="extra")])
    assert "/api/extra/first" not in addresses(app)
    ((level, line), _) = context.hub.say.call_args
    assert level == "error"
    assert f"extra of the page is left out: its route {path} is not below /api/extra or " in line


def test_every_panel_of_quadlabs_own_extensions_can_be_shown() -> None:
    assert files_with(tuple(panels_of_extensions())).problems == []
