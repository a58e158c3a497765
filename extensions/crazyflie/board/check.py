"""Check a Crazyflie: `quadlab vehicle --board crazyflie --check`. No parameter is set."""

from __future__ import annotations

import time
from collections.abc import Callable

from extensions.crazyflie.board.board import CrazyflieBoard
from extensions.crazyflie.board.firmware_parameters import describe
from extensions.crazyflie.board.options import CrazyflieOptions
from quadrotor.errors import LinkError
from quadrotor.parameters import Parameters, ParameterStore
from vehicle.boards.board import RawSample
from vehicle.boards.offered import FIRMWARE
from vehicle_link import clock
from vehicle_link.serial.port import Port

ANSWER_S = 2.0
"""Longest time, in s, without a packet."""
POLL_S = 0.001


def check_board(port: Port, options: Parameters | None, say: Callable[[str], None]) -> list[str]:
    """Report the hardware and firmware that was found, and the settings that must change.

    Returns what prevents a flight. Other values of its parameters do not: they are set at each
    start. Those that the options name are in `options.firmware` from then on. Raises LinkError when
    it does not answer, or flies.
    """
    assert isinstance(options, CrazyflieOptions)
    board = CrazyflieBoard([port], options, is_passive=True)
    newest_s, packets = clock.monotonic(), 0
    samples: list[RawSample] = []
    while not samples and not board.unfit:
        board.service(now_s := clock.monotonic())
        samples = board.receive()
        if board.packets != packets:
            newest_s, packets = now_s, board.packets
        elif now_s - newest_s > ANSWER_S:
            raise LinkError(_silent(packets, getattr(port, "link", "it")))
        time.sleep(POLL_S)
    if board.is_flying:
        raise LinkError("it is flying, and is checked once it has landed")
    if why := board.unfit:
        say(f"not good: {why}")
        return [why]
    say(f"{board.found.device}, firmware {board.found.firmware}")
    say(f"battery {samples[-1].battery_voltage:.2f} V")
    options.firmware = describe(board.found.named, options.wanted)
    if names := ParameterStore(options.firmware).names:
        say(f"shown on the Gains tab: {', '.join(FIRMWARE + name for name in names)}")
    for name, (before, after) in board.found.changed.items():
        say(f"each start sets {name} = {after:g}  # it is {before:g}")
    if why := board.obstacle:
        say(f"it would not arm now: {why}")
    say("good")
    return []


def _silent(packets: int, where: str) -> str:
    if packets:
        return f"{packets} packets from {where}, then none for {ANSWER_S:g} s: is it too far away?"
    return (
        f"no answer from {where} within {ANSWER_S:g} s: is it switched on, is this its channel, "
        "rate and address, and is no other program connected to it?"
    )
