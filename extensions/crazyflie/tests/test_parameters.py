"""Parameters that a board alone knows, from the flight loop to the page's list."""

from __future__ import annotations

import struct

import pytest

from extensions.crazyflie.board.firmware_parameters import describe
from extensions.crazyflie.board.options import CrazyflieOptions
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, ParameterStore
from tests.vehicle.flight.test_loop import Bench
from vehicle import mailbox
from vehicle.comms.commands import FlightMailbox, FlightParameters
from web.parameters.replica import PageParameters

NAMED = {"stabilizer.estimator": (struct.Struct("<B"), 2.0)}
ESTIMATOR = "board.firmware.stabilizer.estimator"


class Root(Parameters):
    board: CrazyflieOptions


def test_they_are_on_the_pages_list_with_the_range_of_their_type(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench(monkeypatch)
    options = CrazyflieOptions(firmware=describe(NAMED, {}))
    bench.stack.store = ParameterStore(Root(board=options))
    parameters = FlightParameters(FlightMailbox(bench.rings), {})
    parameters.fetch()
    bench.samples(1)
    *described, reply = bench.outbox()
    for one in described:
        assert isinstance(one, mailbox.Described)
        parameters.describe(one)
    assert isinstance(reply, mailbox.Reply)
    parameters.deliver(reply)

    page = PageParameters(lambda _: None)
    page.load(parameters.values(), 0, descriptions=parameters.descriptions())
    [row] = [one for one in page.as_json()["parameters"] if one["name"] == ESTIMATOR]
    assert (row["value"], row["minimum"], row["maximum"], row["unit"]) == (2, 0.0, 255.0, "")
    with pytest.raises(OutOfBoundsError, match="allowed 0 to 255"):
        page.check({ESTIMATOR: 256})


def test_what_the_board_confirmed_replaces_the_vehicles_value(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench(monkeypatch)
    bench.mcu.confirmed[ESTIMATOR] = 1
    bench.samples(1)
    assert mailbox.ChangeParameters("", "board", {ESTIMATOR: 1}) in bench.stack.calls
    assert bench.mcu.confirmed == {}
