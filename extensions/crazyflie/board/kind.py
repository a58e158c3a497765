"""The kind of board that a Crazyflie is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from extensions.crazyflie.board.board import CrazyflieBoard
from extensions.crazyflie.board.check import check_board
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.board.traits import SIMULATED, TRAITS
from extensions.crazyflie.crtp.links import UDP_PORT
from quadrotor.parameters import Parameters
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


def _simulate(options: Parameters | None, number: int) -> object:
    from extensions.crazyflie.simulated.firmware import CrazyflieFirmware

    assert isinstance(options, CrazyflieOptions)
    return CrazyflieFirmware(UDP_PORT + number)


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
    simulate=_simulate,
    udp_port=UDP_PORT,
)
