"""The simulated Crazyflie's parameters and log variables, and the ports that serve them."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping

from extensions.crazyflie.board.messages import (
    CONTROL,
    DATA,
    GET_INFO,
    GET_ITEM,
    ITEM,
    LOG_CREATE,
    LOG_RESET,
    LOG_START,
    LOG_TYPES,
    MISC,
    PARAMETER_TYPES,
    READ,
    READ_ONLY,
    TOC,
    TOC_INFO,
    TYPE_BITS,
    WRITE,
)
from extensions.crazyflie.crtp.packets import DATA_MAX, CrtpPort, Packet

BYTE, WORD, FLOAT = 8, 9, 6
LOG_WORD, LOG_FLOAT = 2, 7
LOG_APPEND, LOG_START_TENS, LOG_STOP, LOG_DELETE = 7, 3, 4, 2
"""Commands that our client does not use; LOG_START_TENS has its period in units of 10 ms."""
LOG_BLOCKS, LOG_VARIABLES = 16, 128
NOT_FOUND, TOO_BIG, NO_MEMORY, EXISTS = 2, 7, 12, 17
EXTENDED_TYPE = 7
PARAMETERS: dict[str, tuple[int, float]] = {
    "stabilizer.controller": (BYTE, 1),
    "stabilizer.estimator": (BYTE, 0),
    **{
        f"pid_{loop}.{axis}_{gain}": (FLOAT, value)
        for loop, axes in {
            "rate": {
                "roll": (250.0, 500.0, 2.5),
                "pitch": (250.0, 500.0, 2.5),
                "yaw": (120.0, 16.7, 0.0),
            },
            "attitude": {
                "roll": (6.0, 3.0, 0.0),
                "pitch": (6.0, 3.0, 0.0),
                "yaw": (6.0, 1.0, 0.35),
            },
        }.items()
        for axis, values in axes.items()
        for gain, value in zip(("kp", "ki", "kd"), values, strict=True)
    },
    "cpu.flash": (WORD | READ_ONLY, 1024),
}
"""{name: (type, default)}; the gains are the firmware's defaults for the 2.1+."""


class Contents:
    """One table of contents."""

    def __init__(self, port: CrtpPort, kinds: Mapping[str, int]) -> None:
        self.names, self._kinds, self._port = list(kinds), list(kinds.values()), port
        self._checksum = zlib.crc32(repr(kinds).encode())

    def answer(self, data: bytes) -> Packet | None:
        """Return the answer to a request of the channel TOC."""
        if data[:1] == bytes((GET_INFO,)):
            sizes = bytes((LOG_BLOCKS, LOG_VARIABLES)) if self._port is CrtpPort.LOG else b""
            info = TOC_INFO.pack(GET_INFO, len(self.names), self._checksum)
            return Packet(self._port, TOC, info + sizes)
        if data[:1] != bytes((GET_ITEM,)) or len(data) < ITEM.size:
            return None
        _, number = ITEM.unpack_from(data)
        if number >= len(self.names):
            return Packet(self._port, TOC, data[:1])
        group, name = self.names[number].split(".")
        text = f"{group}\0{name}\0".encode()
        return Packet(self._port, TOC, data[: ITEM.size] + bytes((self._kinds[number],)) + text)


class ParameterPort:
    """The port of the parameters.

    Attributes:
        values: by name.
    """

    def __init__(self) -> None:
        kinds = {name: kind for name, (kind, _) in PARAMETERS.items()}
        self.contents = Contents(CrtpPort.PARAMETERS, kinds)
        self.values = {name: value for name, (_, value) in PARAMETERS.items()}
        self._forms = [
            struct.Struct("<" + PARAMETER_TYPES[kind & TYPE_BITS]) for kind in kinds.values()
        ]

    def answer(self, channel: int, data: bytes) -> Packet | None:
        if channel == TOC:
            return self.contents.answer(data)
        if channel == MISC:
            known = data[:1] == bytes((EXTENDED_TYPE,))
            rest = b"\0\0" if known else bytes((NOT_FOUND,))
            return Packet(CrtpPort.PARAMETERS, MISC, data[:3] + rest)
        number = int.from_bytes(data[:2], "little")
        if number >= len(self._forms):
            return Packet(CrtpPort.PARAMETERS, channel, data[:2] + bytes((NOT_FOUND,)))
        form, name = self._forms[number], self.contents.names[number]
        is_fixed = PARAMETERS[name][0] & READ_ONLY
        if channel == WRITE and len(data) == 2 + form.size and not is_fixed:
            self.values[name] = float(form.unpack_from(data, 2)[0])
        is_whole = form.format[-1] not in "fd"
        value = form.pack(int(self.values[name]) if is_whole else self.values[name])
        done = b"\0" if channel == READ else b""
        return Packet(CrtpPort.PARAMETERS, channel, data[:2] + done + value)


class LogPort:
    """The port of the log blocks.

    Args:
        variables: {name: (type, function that returns the value)}.
    """

    def __init__(self, variables: Mapping[str, tuple[int, Callable[[], float]]]) -> None:
        self._contents = Contents(
            CrtpPort.LOG, {name: kind for name, (kind, _) in variables.items()}
        )
        self._variables = list(variables.values())
        self._blocks: dict[int, list[int]] = {}
        self._periods: dict[int, tuple[int, int]] = {}  # (start, period), ms

    def answer(self, channel: int, data: bytes, now_ms: int) -> Packet | None:
        if channel == TOC:
            return self._contents.answer(data)
        if channel != CONTROL or not data:
            return None
        number = data[1] if len(data) > 1 else 0
        result = self._control(data[0], number, data[2:], now_ms)
        return Packet(CrtpPort.LOG, CONTROL, bytes((data[0], number, result)))

    def _control(self, command: int, number: int, rest: bytes, now_ms: int) -> int:
        if command == LOG_RESET:
            self._blocks.clear()
            self._periods.clear()
        elif command in (LOG_CREATE, LOG_APPEND):
            return self._append(number, rest, is_new=command == LOG_CREATE)
        elif number not in self._blocks:
            return NOT_FOUND
        elif command in (LOG_START, LOG_START_TENS):
            unit_ms = 1 if command == LOG_START else 10
            self._periods[number] = now_ms, max(1, unit_ms * int.from_bytes(rest[:2], "little"))
        elif command in (LOG_STOP, LOG_DELETE):
            self._periods.pop(number, None)
            if command == LOG_DELETE:
                del self._blocks[number]
        return 0

    def _append(self, number: int, items: bytes, *, is_new: bool) -> int:
        if is_new and number in self._blocks:
            return EXISTS
        if is_new and len(self._blocks) >= LOG_BLOCKS:
            return NO_MEMORY
        found = [one for _, one in ITEM.iter_unpack(items[: len(items) // 3 * 3])]
        if any(one >= len(self._variables) for one in found):
            return NOT_FOUND
        block = [*self._blocks.get(number, []), *found]
        if 4 + struct.calcsize(self._layout(block)) > DATA_MAX:
            return TOO_BIG
        self._blocks[number] = block
        return 0

    def due(self, now_ms: int) -> list[Packet]:
        """Return the blocks that are due in this millisecond."""
        return [
            self._block(number, now_ms)
            for number, (start, period) in self._periods.items()
            if (now_ms - start) % period == 0
        ]

    def _block(self, number: int, now_ms: int) -> Packet:
        block = self._blocks[number]
        values = [
            value() if kind == LOG_FLOAT else int(value())
            for kind, value in (self._variables[one] for one in block)
        ]
        stamp = (now_ms & 0xFFFFFF).to_bytes(3, "little")
        data = struct.pack(self._layout(block), *values)
        return Packet(CrtpPort.LOG, DATA, bytes((number,)) + stamp + data)

    def _layout(self, block: list[int]) -> str:
        return "<" + "".join(LOG_TYPES[self._variables[one][0]] for one in block)
