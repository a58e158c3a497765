"""A site with a simulated station."""

from tests.web.conftest import flying, site, station

__all__ = ["flying", "site", "station"]
