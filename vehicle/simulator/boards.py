"""The firmware of a simulated vehicle, by the name of its board."""

from __future__ import annotations

from quadrotor.errors import UsageError
from quadrotor.parameters import Parameters
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle.boards.crazyflie.options import CrazyflieOptions
from vehicle.boards.kind import BETAFLIGHT, CRAZYFLIE, MIKROKOPTER
from vehicle.simulator.betaflight.firmware import BetaflightFirmware
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.crazyflie.firmware import CrazyflieFirmware
from vehicle_link.crtp.links import UDP_PORT


def firmware_of(board: str, options: Parameters | None, number: int = 0) -> BoardFirmware | None:
    """Return the firmware of a simulated vehicle with this board; None: the simulator's own one.

    Args:
        number: of the vehicle, from 0.

    Raises UsageError for a board that cannot be simulated, and the errors of `BetaflightProcess`.
    """
    if board == MIKROKOPTER:
        return None
    if isinstance(options, BetaflightOptions):
        return BetaflightFirmware(options)
    if isinstance(options, CrazyflieOptions):
        return CrazyflieFirmware(UDP_PORT + number)
    raise UsageError(
        f"board {board} is not simulated: fly {MIKROKOPTER}, {BETAFLIGHT} or {CRAZYFLIE}, or the "
        "vehicle itself"
    )
