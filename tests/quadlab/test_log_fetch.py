"""`quadlab log fetch` at a real station over loopback, and the output of `log info`."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, store_completeness
from flight_log.writer import FILLED_METADATA, LogWriter
from quadlab.__main__ import main
from tests.flight_log.drop_outs import Flight, flown
from tests.support.transfers import new_transfers
from tests.waiting import free_port
from vehicle.onboard_log.files import OnboardFiles
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import hub_session

NAME = "quad1_20260131T093042_120Z"


@pytest.fixture
def port(tmp_path: Path) -> Iterator[int]:
    """Yield the port of a station whose vehicle has one log."""
    Flight(flown(300), np.ones(300, np.bool_)).log_onboard(tmp_path / "board" / f"{NAME}.mcap")
    number = free_port()
    sessions: list[Any] = [hub_session(number), loopback_session(number)]
    station, vehicle = (
        Node(sessions[0], "/quad1", "station"),
        Node(sessions[1], "/quad1", "vehicle"),
    )
    OnboardFiles(tmp_path / "board", list).serve(vehicle)
    catalogue = Catalogue(tmp_path / "data")
    transfers = new_transfers(station, catalogue)
    closing = threading.Event()

    def beat() -> None:
        """Report so often that the report of an ended transfer is sent before each new request."""
        while not closing.wait(0.001):
            transfers.tick(0)

    beating = threading.Thread(target=beat)
    beating.start()
    yield number
    closing.set()
    beating.join()
    transfers.close()
    for node in (station, vehicle):
        node.close()
    for session in reversed(sessions):
        session.close()
    catalogue.close()


def test_a_log_is_listed_and_fetched(
    tmp_path: Path, port: int, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["log", "fetch", "--loopback-port", str(port)]
    assert main(words) == 0
    assert f"{NAME}.mcap" in capsys.readouterr().out
    assert main([*words, "nothing"]) == 1
    assert f"the newest is {NAME}.mcap" in capsys.readouterr().err
    assert main([*words, NAME]) == 0
    assert "is in the folder onboard/" in capsys.readouterr().out
    there = tmp_path / "data" / "onboard" / "quad1" / f"{NAME}.mcap"
    assert there.read_bytes() == (tmp_path / "board" / f"{NAME}.mcap").read_bytes()
    assert main([*words, "newest"]) == 0
    assert "it had been downloaded before" in capsys.readouterr().out
    assert main([*words, NAME, "--cancel"]) == 1
    assert "no transfer of" in capsys.readouterr().err


def test_without_a_name_there_is_nothing_to_cancel(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["log", "fetch", "--cancel"]) == 2
    assert "--cancel needs the name" in capsys.readouterr().err


def test_info_tells_what_was_filled_and_what_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "data" / "runs"
    told = {"seconds": "3.2", "missing_seconds": "0.8", "missing": "the vehicle's log is damaged"}
    for folder in (tmp_path, runs):
        with LogWriter(folder / "r1.mcap", {"vehicle": "quad1"}, {}) as log:
            log.add_metadata(FILLED_METADATA, told)
    assert main(["log", "info", str(tmp_path / "r1.mcap")]) == 0
    said = capsys.readouterr().out
    assert "3.2 s were restored from the vehicle's log; 0.8 s missing" in said
    catalogue = Catalogue(tmp_path / "data")
    store_completeness(catalogue, "r1", Completeness("complete", 0.0, 0.0, 9.0, "4500 ticks"))
    catalogue.close()
    assert main(["log", "info", str(runs / "r1.mcap")]) == 0
    assert "ticks: complete: 4500 ticks" in capsys.readouterr().out
