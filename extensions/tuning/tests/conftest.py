"""A site whose vehicle flies step tests, and pages without a browser."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from console.catalogue.catalogue import Catalogue
from extensions.tuning.tests.step_vehicle import StepVehicle
from tests.web.conftest import Site, serving, until
from tests.web.dom.conftest import context, dom, look_at, open_page

__all__ = ["context", "dom", "look_at", "open_page", "until"]


@pytest.fixture(scope="module")
def tune_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Yield a site whose vehicle flies step tests: `site.vehicle`, see step_vehicle.py."""
    data, ended = tmp_path_factory.mktemp("tune"), threading.Event()
    with serving(data, Catalogue(data)) as running:
        running.vehicle = StepVehicle(running.station)

        def fly() -> None:
            while not ended.wait(0.02):
                running.station.fly()

        thread = threading.Thread(target=fly, daemon=True)
        thread.start()
        yield running
        ended.set()
        thread.join()
