"""A station with a vehicle, and sites and pages of a scripted one."""

from __future__ import annotations

from tests.console.conftest import linked
from tests.web.conftest import admin, beacon_site, flying, operator, station, until
from tests.web.dom.conftest import context, dom, look, open_page, page

__all__ = [
    "admin",
    "beacon_site",
    "context",
    "dom",
    "flying",
    "linked",
    "look",
    "open_page",
    "operator",
    "page",
    "station",
    "until",
]
