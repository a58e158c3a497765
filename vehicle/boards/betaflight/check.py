"""`quadlab vehicle --board betaflight --check`: which firmware it is, and what must change on it.

Nothing is written to the board. Its command line blocks arming and is left by a restart, so that
the check ends with one.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from quadrotor.errors import LinkError
from vehicle.boards.betaflight.arming import why_not_armed
from vehicle.boards.betaflight.configuration import lines_to_enter
from vehicle.boards.betaflight.messages import Function, check_firmware, decode_status
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle_link.msp.frames import MessageDecoder, encode
from vehicle_link.serial.port import Port

ANSWER_S = 2.0
"""An answer has to come within this time."""
ENTER = "not good: enter these lines in its command line, then check again:"
PROMPT = b"\r\n# "
DUMP_S = 20.0
"""A dump is 13 kB: 1.2 s at 115200 Bd."""
POLL_S, QUIET_S = 0.005, 0.3

Say = Callable[[str], None]


def check_board(port: Port, options: BetaflightOptions, say: Say) -> bool:
    """Report the firmware, what blocks arming, and the lines to enter; return whether it fits.

    Raises LinkError when the board does not answer.
    """
    variant, version = _ask(port, Function.VARIANT), _ask(port, Function.VERSION)
    if why := check_firmware(variant, version):
        say(f"not good: {why}")
        return False
    say(f"Betaflight {'.'.join(str(part) for part in version[:3])}")
    status = decode_status(_ask(port, Function.STATUS))
    if blocks := why_not_armed(status.arming_blocks, status.block_count):
        say(f"it would not arm now: {blocks}")
    port.write(b"#")  # alone: it counts only when nothing follows
    _prompt(port, ANSWER_S, "its command line did not open")
    port.write(b"dump\n")
    dump = _prompt(port, DUMP_S, "its command line did not finish `dump`")
    port.write(b"exit\n")
    lines = lines_to_enter(dump.decode("ascii", "replace"), options)
    if lines:
        say(ENTER)
    for line in lines:
        say(line)
    if not lines:
        say("good")
    return not lines


def _ask(port: Port, function: Function) -> bytes:
    decoder = MessageDecoder()
    port.write(encode(function))
    deadline_s = time.monotonic() + ANSWER_S
    while time.monotonic() < deadline_s:
        for message in decoder.feed(port.read()):
            if message.function == function:
                return message.payload
        time.sleep(POLL_S)
    raise LinkError(
        f"no answer to MSP {function.name} within {ANSWER_S:g} s: is this the port with MSP, and "
        "is no configurator connected?"
    )


def _prompt(port: Port, patience_s: float, what: str) -> bytes:
    """Return what was written up to a prompt that nothing follows: comments begin like one."""
    written = b""
    newest_s = time.monotonic()
    deadline_s = newest_s + patience_s
    while (now_s := time.monotonic()) < deadline_s:
        if data := port.read():
            written, newest_s = written + data, now_s
        elif written.endswith(PROMPT) and now_s - newest_s > QUIET_S:
            return written
        time.sleep(POLL_S)
    raise LinkError(f"{what} within {patience_s:g} s; the board may need to be switched off and on")
