"""The header of a log of Betaflight's blackbox: names, predictors and encodings of its fields, and
the scales of its sensors.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from extensions.importers.readers import blackbox_frames as frames
from quadrotor.errors import LogFormatError

LINE = re.compile(rb"H ([^:\n]{1,200}):([^\n]{0,4000})\n")
LONGEST_INTERVAL = 4096
"""Iterations between two I frames; firmware writes up to 1024."""
RADIANS_BELOW = 1e-6
"""A smaller scale of the gyroscope is in rad/us, as Baseflight wrote it."""
DEGREES = 180.0 / np.pi


class Log(NamedTuple):
    """One log of a file, by its header."""

    where: str  # the file and the log's number, for messages
    header: Mapping[str, str]
    names: list[str]
    fields: frames.Numbers  # as `decode` takes them
    others: frames.Numbers
    setting: frames.Numbers
    begin: int  # of its frames, as a place in the file
    end: int
    is_last: bool


def described(data: bytes, where: str, start: int, end: int, *, is_last: bool) -> Log:
    """Read the header with which the bytes `data` from `start` in the file begin. Raises
    LogFormatError.
    """
    header, at = {}, 0
    while found := LINE.match(data, at):
        header[found[1].decode(errors="replace")] = found[2].decode(errors="replace").strip()
        at = found.end()
    try:
        names, fields = _fields(header)
        others, setting = _others(header), _setting(header, names, fields)
        one_g(header), degrees(header)
    except (KeyError, ValueError, OverflowError) as error:
        raise LogFormatError(f"{where}: its header cannot be read: {error!s:.120}") from None
    return Log(
        where,
        header,
        names,
        fields=fields,
        others=others,
        setting=setting,
        begin=start + at,
        end=end,
        is_last=is_last,
    )


def one_g(header: Mapping[str, str]) -> int:
    """Return how many counts of the accelerometer are 1 g; 0 without one."""
    return max(int(header.get("acc_1G", "0")), 0)


def degrees(header: Mapping[str, str]) -> float:
    """Return deg/s of a count of the gyroscope. Raises ValueError."""
    text = header.get("gyro_scale", header.get("gyro.scale", "0x3f800000"))
    (scale,) = struct.unpack(">f", int(text, 0).to_bytes(4, "big"))
    if abs(scale) < RADIANS_BELOW:
        scale *= 1e6 * DEGREES
    return float(scale) / (10.0 if header.get("blackbox_high_resolution", "0") != "0" else 1.0)


def _listed(header: Mapping[str, str], kind: str, what: str) -> list[str]:
    """Return the items of a line about the fields of a kind. Raises KeyError."""
    return header[f"Field {kind} {what}"].split(",")


def _fields(header: Mapping[str, str]) -> tuple[list[str], frames.Numbers]:
    """Return names and description of the fields of main frames. Raises KeyError or ValueError."""
    names = _listed(header, "I", "name")
    lines = [_listed(header, "I", "signed")]
    for kind in "IP":
        lines += [_listed(header, kind, "predictor"), _listed(header, kind, "encoding")]
    table = np.array([[int(one) for one in line] for line in lines], np.int64)
    if table.shape != (5, len(names)) or len(set(names)) < len(names):
        raise ValueError("its lists of fields do not fit together")
    version = header.get("Data version", "2")
    for row in (frames.I_ENCODING, frames.P_ENCODING):
        table[row] = _encodings(table[row].tolist(), version)
    wrong = {*table[frames.I_PREDICTOR].tolist(), *table[frames.P_PREDICTOR].tolist()}
    if unknown := wrong - set(frames.PREDICTORS):
        raise ValueError(f"predictor {min(unknown)} is not known")
    return names, table


def _encodings(found: list[int], version: str) -> list[int]:
    """Return encodings as `blackbox_frames` numbers them. Raises ValueError."""
    if version == "1":
        found = [frames.TAG8_4S16_OLD if one == frames.TAG8_4S16 else one for one in found]
    if unknown := set(found) - frames.ENCODINGS:
        raise ValueError(f"encoding {min(unknown)} is not known")
    smallest(found)
    return found


def smallest(encodings: Collection[int]) -> int:
    """Return the smallest size of a frame in bytes. Raises ValueError for an incomplete group."""
    size, left, before = 1, 0, -1
    for one in map(int, encodings):
        if left and before not in (one, frames.TAG8_8SVB):
            break
        if not left or one != before:
            left = frames.GROUPS.get(one, 1)
            size += one != frames.NOTHING
        before, left = one, left - 1
    if left and before != frames.TAG8_8SVB:
        raise ValueError(f"a group of the encoding {before} is incomplete")
    return size


def _others(header: Mapping[str, str]) -> frames.Numbers:
    """Return the encodings of the other kinds of frames. Raises KeyError or ValueError."""
    version = header.get("Data version", "2")
    found = [
        _encodings([int(one) for one in _listed(header, kind, "encoding")], version)
        if f"Field {kind} encoding" in header
        else []
        for kind in "SGH"
    ]
    width = max(1, *map(len, found))
    padded = [[*one, *[frames.NOTHING] * (width - len(one))] for one in found]
    return np.array(padded, np.int64)


def _setting(header: Mapping[str, str], names: list[str], fields: frames.Numbers) -> frames.Numbers:
    """Return the numbers that decoding needs. Raises KeyError or ValueError."""
    part, _, of = header.get("P interval", "1/1").rpartition("/")
    setting = [
        names.index("loopIteration"),
        names.index("time"),
        names.index("motor[0]") if "motor[0]" in names else -1,
        int(header.get("I interval", "32")),
        int(part or "1"),
        int(of),
        int(header.get("minthrottle", "0")),
        int(header.get("vbatref", "0")),
        int(header.get("motorOutput", "0").partition(",")[0]),
    ]
    if setting[frames.P_OF] == 0:  # I frames alone
        setting[frames.P_OF] = setting[frames.I_INTERVAL]
    if setting[frames.I_INTERVAL] > LONGEST_INTERVAL:
        raise ValueError(f"its I interval is {setting[frames.I_INTERVAL]}")
    if min(setting[frames.I_INTERVAL : frames.MIN_THROTTLE]) < 1:
        raise ValueError("its intervals are no numbers above 0")
    for row in (frames.I_PREDICTOR, frames.P_PREDICTOR):
        for needed, word in {4: "minthrottle", 9: "vbatref", 11: "motorOutput"}.items():
            if needed in fields[row] and word not in header:
                raise ValueError(f"{word} is missing")
        if 5 in fields[row][: max(setting[frames.MOTOR0], 0) + 1] or (
            5 in fields[row] and setting[frames.MOTOR0] < 0
        ):
            raise ValueError("motor[0] is missing before the other motors")
    return np.array(setting, np.int64)
