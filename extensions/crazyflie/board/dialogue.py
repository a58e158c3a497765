"""The dialogue with a Crazyflie at the start: version, tables of contents, parameters, log blocks.

A table of contents is read once for each checksum and kept for later starts of this process.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterable, Mapping
from fnmatch import fnmatchcase

import msgspec

from extensions.crazyflie.board.messages import (
    BLOCKS,
    CONTROL,
    GET_INFO,
    GET_ITEM,
    ITEM,
    LOG_CREATE,
    LOG_RESET,
    LOG_START,
    LOG_TYPES,
    NEWEST,
    OLDEST,
    PARAMETER_TYPES,
    READ,
    READ_ONLY,
    TOC,
    TOC_INFO,
    TYPE_BITS,
    VERSION,
    WRITE,
    Block,
    Dialogue,
    Request,
)
from extensions.crazyflie.crtp.packets import CrtpPort, Packet
from quadrotor.errors import LinkError
from quadrotor.similar_names import did_you_mean


class Entry(msgspec.Struct, frozen=True):
    """One variable of a table of contents."""

    number: int
    kind: int  # its type's number

    def form(self, types: dict[int, str]) -> struct.Struct:
        """Return its layout. Raises LinkError."""
        try:
            return struct.Struct("<" + types[self.kind & TYPE_BITS])
        except KeyError:
            raise LinkError(f"the Crazyflie names an unknown type, {self.kind:#x}") from None


Contents = Mapping[str, Entry]
"""Variables by GROUP.NAME."""
MOST_NAMED = 64
"""Largest number of parameters that `board.parameters` names."""
_READ: dict[tuple[int, int, int], Contents] = {}
"""Tables of contents that were read, by port, number of entries and checksum."""


class Found:
    """The result of the dialogue.

    Attributes:
        changed: the parameters that were set, {name: (before, after)}.
        confirmed: the parameters that were to be set, as the Crazyflie has them.
        named: the parameters that the options name, {name: (layout, value)}.
        forms: layout of each log block's values.
    """

    def __init__(self) -> None:
        self.firmware = self.device = ""
        self.changed: dict[str, tuple[float, float]] = {}
        self.confirmed: dict[str, float] = {}
        self.named: dict[str, tuple[struct.Struct, float]] = {}
        self.forms: dict[int, struct.Struct] = {}


def introduce(
    found: Found, named: Iterable[str], wanted: Mapping[str, float], *, write: bool = True
) -> Dialogue:
    """Get to know a Crazyflie, set these parameters, start its log blocks.

    Args:
        named: names and patterns of the parameters that the options name.
        write: False only reads the parameters, all that are named.

    Raises LinkError for a board that cannot be flown.
    """
    version = yield Request(Packet(CrtpPort.PLATFORM, VERSION, b"\x00"))
    check_version(version[1] if len(version) > 1 else 0)
    firmware = yield Request(Packet(CrtpPort.PLATFORM, VERSION, b"\x01"))
    device = yield Request(Packet(CrtpPort.PLATFORM, VERSION, b"\x02"))
    found.firmware, found.device = (_text(data[1:]) for data in (firmware, device))
    yield from set_parameters(found, wanted, named, write=write)
    variables = yield from read_contents(CrtpPort.LOG)
    yield Request(Packet(CrtpPort.LOG, CONTROL, bytes((LOG_RESET,))))
    for block in BLOCKS:
        yield from _start(block, variables, found)


def set_parameters(
    found: Found, wanted: Mapping[str, float], named: Iterable[str] = (), *, write: bool = True
) -> Dialogue:
    """Set the parameters that differ from the given values, and read them back.

    Raises LinkError for a name or a value that the board does not have.
    """
    parameters = yield from read_contents(CrtpPort.PARAMETERS)
    for name in select(parameters, named):
        if not write:
            entry = parameters[name]
            value = yield from _read(entry, name)
            found.named[name] = entry.form(PARAMETER_TYPES), value
    for name, value in wanted.items():
        entry = find(parameters, name, "parameter")
        form = entry.form(PARAMETER_TYPES)
        before = yield from _read(entry, name)
        data = _packed(form, name, value)
        (after,) = form.unpack(data)
        if after != before:
            found.changed[name] = float(before), value
            if write:
                yield from _write(entry, name, data)
        found.confirmed[name] = after


def check_version(version: int) -> None:
    """Raise LinkError for a version of CRTP that was not tried."""
    if not OLDEST <= version <= NEWEST:
        what = "older than" if version < OLDEST else "newer than"
        raise LinkError(
            f"the Crazyflie speaks CRTP {version}, {what} {OLDEST}, the version that was tried: "
            "flash a firmware of 2026 with cfclient"
        )


def read_contents(port: CrtpPort) -> Generator[Request, bytes, Contents]:
    """Read the table of contents of parameters or log variables."""
    info = yield Request(Packet(port, TOC, bytes((GET_INFO,))))
    found = _unpack(TOC_INFO, info, f"{port.name} information")
    count, checksum = int(found[1]), int(found[2])
    key = int(port), count, checksum
    if key not in _READ:
        contents: dict[str, Entry] = {}
        for number in range(count):
            item = yield Request(Packet(port, TOC, ITEM.pack(GET_ITEM, number)), 3)
            group, _, name = item[4:].partition(b"\0")
            contents[f"{_text(group)}.{_text(name)}"] = Entry(number, item[3])
        _READ[key] = contents
    return _READ[key]


def find(contents: Contents, name: str, what: str) -> Entry:
    """Return the entry of a name. Raises LinkError that suggests similar names."""
    is_log = what != "parameter"
    others = {n: one for n, one in contents.items() if is_log or not one.kind & READ_ONLY}
    if name in others:
        return others[name]
    if name in contents:
        raise LinkError(f"{name} of the Crazyflie is read-only")
    hint = did_you_mean(name, others) or f"it has {len(others)} others"
    raise LinkError(f"the Crazyflie has no {what} {name}; {hint}")


def select(contents: Contents, named: Iterable[str]) -> list[str]:
    """Return the parameters of these names and patterns. Raises LinkError."""
    found: dict[str, None] = {}
    for name in named:
        of_pattern = [
            one
            for one, entry in contents.items()
            if fnmatchcase(one, name) and not entry.kind & READ_ONLY
        ]
        if not of_pattern:
            find(contents, name, "parameter")
        found |= dict.fromkeys(of_pattern)
    if len(found) > MOST_NAMED:
        raise LinkError(
            f"board.parameters names {len(found)} parameters; at most {MOST_NAMED} can be shown: "
            "name fewer, like pid_rate.*"
        )
    return list(found)


def _read(entry: Entry, name: str) -> Generator[Request, bytes, float]:
    number = struct.pack("<H", entry.number)
    answer = yield Request(Packet(CrtpPort.PARAMETERS, READ, number), 2)
    return _unpack(entry.form(PARAMETER_TYPES), answer[3:], name)[0]


def _packed(form: struct.Struct, name: str, value: float) -> bytes:
    is_float = form.format[-1:] in ("f", "d")
    try:
        return form.pack(value if is_float else int(value))
    except (struct.error, OverflowError):
        raise LinkError(f"board.parameters: {name} cannot be {value:g}") from None


def _write(entry: Entry, name: str, data: bytes) -> Dialogue:
    form, number = entry.form(PARAMETER_TYPES), struct.pack("<H", entry.number)
    answer = yield Request(Packet(CrtpPort.PARAMETERS, WRITE, number + data), 2)
    (set_to,) = _unpack(form, answer[2:], name)
    if (set_to,) != form.unpack(data):
        raise LinkError(f"the Crazyflie set {name} to {set_to:g}, not to {form.unpack(data)[0]:g}")


def _start(block: Block, variables: Contents, found: Found) -> Dialogue:
    entries = [find(variables, name, "log variable") for name in block.names]
    layout = "".join(entry.form(LOG_TYPES).format[1:] for entry in entries)
    found.forms[block.number] = struct.Struct("<" + layout)
    items = b"".join(ITEM.pack(entry.kind & TYPE_BITS, entry.number) for entry in entries)
    period = struct.pack("<H", block.period_ms)
    for command, rest in ((LOG_CREATE, items), (LOG_START, period)):
        data = bytes((command, block.number)) + rest
        answer = yield Request(Packet(CrtpPort.LOG, CONTROL, data), 2)
        if answer[2:3] not in (b"\x00", b"\x11"):  # EEXIST: an answer was lost
            raise LinkError(
                f"the Crazyflie refuses log block {block.number} ({', '.join(block.names)}) with "
                f"error {answer[2:3].hex() or 'none'}"
            )


def _unpack(form: struct.Struct, data: bytes, what: str) -> tuple[float, ...]:
    if len(data) < form.size:
        raise LinkError(f"the Crazyflie answers {len(data)} bytes for {what}, not {form.size}")
    return form.unpack_from(data)


def _text(data: bytes) -> str:
    return data.split(b"\0")[0].decode("ascii", "replace")
