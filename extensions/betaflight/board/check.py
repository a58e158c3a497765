"""Check a board's firmware and settings: `quadlab vehicle --board betaflight --check`.

Nothing is written to the board. Its open command line blocks arming, and leaving it restarts the
board, so the check ends with a restart.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from extensions.betaflight.board.arming import why_not_armed
from extensions.betaflight.board.configuration import lines_to_enter
from extensions.betaflight.board.messages import ARM_BOX, Function, check_firmware, decode_status
from extensions.betaflight.board.options import BetaflightOptions
from extensions.betaflight.msp.frames import MessageDecoder, encode
from quadrotor.errors import LinkError
from quadrotor.parameters import Parameters
from vehicle_link import clock
from vehicle_link.serial.port import Port, PortError

ANSWER_S = 2.0
"""Longest time, in s, to wait for an answer."""
RESTART_S = 15.0
BY_THROTTLE = (
    "no barometer, or a firmware without altitude hold (`ap_hover_throttle`): its own landing is "
    "by `failsafe_throttle` alone, and the faster the higher it begins"
)
ENTER = "not good: enter these lines in its command line, then check again:"
PROMPT = b"\r\n# "
DUMP_S = 20.0
"""A dump is 13 kB: 1.2 s at 115200 Bd."""
DUMPS = 4
"""Largest number of times that settings which differ are read until two answers agree: a line
without flow control may lose bytes."""
POLL_S, QUIET_S = 0.005, 0.3

Say = Callable[[str], None]


def check_board(port: Port, options: Parameters | None, say: Say) -> list[str]:
    """Report the firmware, what blocks arming, and the lines to enter.

    Returns these lines, or what is wrong with the firmware. The board is checked only while
    disarmed, and has restarted when this returns. Raises LinkError when it does not answer.
    """
    assert isinstance(options, BetaflightOptions)
    variant = _variant(port)
    version = _ask(port, Function.VERSION)
    if why := check_firmware(variant, version, newer=options.newer):
        say(f"not good: {why}")
        return [why]
    ids, status = _ask(port, Function.BOX_IDS), decode_status(_ask(port, Function.STATUS))
    if ARM_BOX in status.modes(ids):
        raise LinkError("it is armed, and is checked once it has landed and disarmed")
    say(f"Betaflight {'.'.join(str(part) for part in version[:3])}")
    if blocks := why_not_armed(status.arming_blocks, status.block_count):
        say(f"it would not arm now: {blocks}")
    port.write(b"#")  # alone: it counts only when nothing follows
    _prompt(port, ANSWER_S, "its command line did not open")
    lines: list[str] | None = None
    for _ in range(DUMPS):
        before, dump = lines, _dump(port)
        lines = lines_to_enter(dump, options)
        if not lines or lines == before:
            break
    else:
        raise LinkError(f"{DUMPS} answers to `dump` differ: its line loses bytes; is it congested?")
    port.write(b"exit\n")
    if not (status.has_barometer and "ap_hover_throttle" in dump):
        say(BY_THROTTLE)
    if lines:
        say(ENTER)
    for line in lines:
        say(line)
    _await_restart(port)
    if not lines:
        say("good")
    return lines


def _variant(port: Port) -> bytes:
    """Return the firmware's name; restart the board first if its command line was left open."""
    try:
        return _ask(port, Function.VARIANT)
    except PortError:
        raise
    except LinkError:
        port.write(b"\nexit\n")
        _await_restart(port)
        return _ask(port, Function.VARIANT)


def _await_restart(port: Port) -> None:
    """Wait until the board answers again, or its USB device has vanished and must be reopened.

    Raises LinkError.
    """
    deadline_s = clock.monotonic() + RESTART_S
    while True:
        try:
            _ask(port, Function.VARIANT)
            return
        except PortError:
            return
        except LinkError as error:
            if clock.monotonic() > deadline_s:
                raise error from None


def _ask(port: Port, function: Function) -> bytes:
    decoder = MessageDecoder()
    port.write(encode(function))
    deadline_s = clock.monotonic() + ANSWER_S
    while clock.monotonic() < deadline_s:
        for message in decoder.feed(port.read()):
            if message.function == function:
                return message.payload
        time.sleep(POLL_S)
    raise LinkError(
        f"no answer to MSP {function.name} within {ANSWER_S:g} s: is this the port with MSP, and "
        "is no configurator connected?"
    )


def _dump(port: Port) -> str:
    port.write(b"dump\n")
    said = _prompt(port, DUMP_S, "its command line did not finish `dump`")
    return said.decode("ascii", "replace")


def _prompt(port: Port, patience_s: float, what: str) -> bytes:
    """Return the output up to a prompt that nothing follows, as comments also begin with `#`."""
    written = b""
    newest_s = clock.monotonic()
    deadline_s = newest_s + patience_s
    while (now_s := clock.monotonic()) < deadline_s:
        if data := port.read():
            written, newest_s = written + data, now_s
        elif written.endswith(PROMPT) and now_s - newest_s > QUIET_S:
            return written
        time.sleep(POLL_S)
    raise LinkError(f"{what} within {patience_s:g} s; the board may need to be switched off and on")
