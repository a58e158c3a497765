"""Sites of scripted vehicles."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from tests.web.conftest import serve, until

__all__ = ["serve", "until"]

NAMES = ("quad1", "quad2", "quad3")
PLACES = ((0.0, 0.0, 1.0), (2.0, 0.0, 1.6), (1.0, 1.8, 1.2))
PERIOD = 0.02  # s


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    """Yield a site whose three vehicles fly velocity."""
    data, ended = tmp_path_factory.mktemp("formation"), threading.Event()
    with serve(data, Catalogue(data), vehicles=NAMES) as running:

        def fly() -> None:
            while not ended.wait(PERIOD):
                for station, place in zip(running.stations, PLACES, strict=True):
                    station.fly(*place)

        thread = threading.Thread(target=fly, daemon=True)
        thread.start()
        yield running
        ended.set()
        thread.join()
