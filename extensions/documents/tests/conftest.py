"""A site with a simulated station, and pages without a browser."""

from tests.web.conftest import flying, site, station
from tests.web.dom.conftest import context, dom, look_at, open_page

__all__ = ["context", "dom", "flying", "look_at", "open_page", "site", "station"]
