"""A site with a simulated station, and pages without a browser."""

from tests.web.browser.conftest import chromium, launch, profiles
from tests.web.conftest import flying, site, station
from tests.web.dom.conftest import context, dom, look_at, open_page

__all__ = [
    "chromium",
    "context",
    "dom",
    "flying",
    "launch",
    "look_at",
    "open_page",
    "profiles",
    "site",
    "station",
]
