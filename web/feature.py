"""A feature of the page, by which an extension or the page itself adds routes to every vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fastapi import FastAPI

from quadrotor.errors import UsageError
from web.vehicle_context import VehicleContext


@dataclass(frozen=True)
class Feature:
    """A part of the page.

    Attributes:
        routes: adds the routes of one vehicle; services of that vehicle are ended by
            `VehicleContext.closing`.
        stop: ends the services that all vehicles share.
        name: name of an extension's feature, below which its routes are; "" for the page's own.
    """

    routes: Callable[[FastAPI, VehicleContext], None]
    stop: Callable[[], None] = lambda: None
    name: str = ""

    def add(self, app: FastAPI, context: VehicleContext) -> None:
        """Add its routes to one vehicle's application.

        Raises UsageError, and adds none, if one of them is outside the prefix of an extension's
        feature.
        """
        before = len(app.router.routes)
        self.routes(app, context)
        if not self.name:
            return
        allowed = f"/api/{self.name}", f"/{self.name}"
        for route in app.router.routes[before:]:
            path = getattr(route, "path", "")
            if path not in allowed and not path.startswith(tuple(f"{one}/" for one in allowed)):
                del app.router.routes[before:]
                raise UsageError(
                    f"the feature {self.name} of the page is left out: its route {path} is not "
                    f"below {' or '.join(allowed)}; rename it"
                )
