"""The firmware of a simulated vehicle, by the name of its board."""

from __future__ import annotations

from quadrotor.errors import UsageError
from quadrotor.parameters import Parameters
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.simulator.board_firmware import BoardFirmware


def firmware_of(board: str, options: Parameters | None, number: int = 0) -> BoardFirmware | None:
    """Return the firmware of a simulated vehicle with this board; None: the simulator's own one.

    Args:
        number: of the vehicle, from 0.

    Raises UsageError for a board that cannot be simulated, and what its simulation raises.
    """
    if board == MIKROKOPTER:
        return None
    simulate = find_kind(board).simulate
    if simulate is None:
        raise UsageError(
            f"board {board} is not simulated: fly {MIKROKOPTER} or another simulated one, or the "
            "vehicle itself"
        )
    firmware = simulate(options, number)
    assert isinstance(firmware, BoardFirmware)
    return firmware
