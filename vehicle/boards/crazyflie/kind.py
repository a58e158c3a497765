"""The kind of board that a Crazyflie is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from quadrotor.parameters import Parameters
from vehicle.boards.crazyflie.board import CrazyflieBoard
from vehicle.boards.crazyflie.check import check_board
from vehicle.boards.crazyflie.options import CrazyflieOptions
from vehicle.boards.crazyflie.traits import SIMULATED, TRAITS
from vehicle.boards.kind import Kind
from vehicle_link import clock
from vehicle_link.serial.port import BAUD_RATE, Port


def _connect(
    ports: Sequence[Port],
    options: Parameters | None,
    rate: int,
    now_ns: Callable[[], int] | None,
    unfit: str = "",
) -> CrazyflieBoard:
    assert isinstance(options, CrazyflieOptions)
    return CrazyflieBoard(ports, options, now_ns=now_ns or clock.time_ns, unfit=unfit)


KIND = Kind(
    TRAITS,
    _connect,
    CrazyflieOptions,
    live=True,
    rate=100,
    bauds=(BAUD_RATE,),
    example="radio://0/80/2M/E7E7E7E7E7",
    poll_ms=1,
    check=check_board,
    simulated=SIMULATED,
    station={"preflight.battery_min": 3.5},
)
