"""Names and values of parameters as MAVLink has them: 16 characters, and 4 bytes as a float.

A short name is a function of the full name alone, so that it stays the same when others are added:
the component's first letter, then its words, of which the longest loses its last vowel, or without
one its last letter, until all fit. docs/parameters.md has the table.
"""

from __future__ import annotations

import math
import re
import struct

import numpy as np

from quadrotor.errors import WrongTypeError
from quadrotor.parameter_description import ParameterDescription, ParameterValue

LONGEST = 16
VOWELS = "aeiou"
INT32, REAL32 = 6, 9
"""MAV_PARAM_TYPE_INT32 and MAV_PARAM_TYPE_REAL32."""
LOWEST, HIGHEST = -(2**22), 0x7F80_0000
"""Range of the integers that survive four bytes read as a float: beyond it, but for some, the bytes
are those of a signalling NaN, of which a float's conversion sets a bit, or there are too few."""


def short_name(name: str) -> str:
    """Return the name of at most 16 characters: `control.position.kp_xy` is C_POSITION_KP_XY."""
    head, *words = re.split(r"[._]", name)
    words.insert(0, head[:1])
    while sum(map(len, words)) + len(words) - 1 > LONGEST:
        at = max(range(len(words)), key=lambda k: (len(words[k]), -k))
        word = words[at]
        last = max((k for k in range(1, len(word)) if word[k] in VOWELS), default=len(word) - 1)
        words[at] = word[:last] + word[last + 1 :]
    return "_".join(words).upper()


def has_short_name(described: ParameterDescription) -> bool:
    """Return whether MAVLink has a type for its values: numbers, and texts of a list of choices."""
    return described.type != "str" or bool(described.choices)


def is_faithful(described: ParameterDescription) -> bool:
    """Return whether every allowed value survives the four bytes of a message."""
    if described.type != "int" or described.choices:
        return True
    low = -math.inf if described.minimum is None else described.minimum
    high = math.inf if described.maximum is None else described.maximum
    return low >= LOWEST and high <= HIGHEST


def encoded(described: ParameterDescription, value: ParameterValue) -> tuple[float, int]:
    """Return a value as the four bytes of a message, read as a float, and its MAVLink type.

    Integers are sent by their bytes; a text by its number in the list of choices.
    """
    if described.type == "float":
        return float(value), REAL32
    number = described.choices.index(str(value)) if described.choices else int(value)
    return struct.unpack("<f", struct.pack("<i", number))[0], INT32


def decoded(described: ParameterDescription, sent: float, kind: int) -> ParameterValue:
    """Return the value that a message carries. Raises WrongTypeError.

    A float is the shortest decimal with these four bytes: 0.1, not 0.10000000149.
    """
    if described.type == "float":
        if kind != REAL32:
            raise WrongTypeError(
                f"parameter {described.name} is a float; it was sent as type {kind}"
            )
        return float(str(np.float32(sent)))
    if kind == REAL32 and math.isfinite(sent):
        number = int(sent)  # of a program that knows no other type
    else:
        number = struct.unpack("<i", struct.pack("<f", sent))[0]
    if described.choices:
        if not 0 <= number < len(described.choices):
            listed = ", ".join(f"{k} {one}" for k, one in enumerate(described.choices))
            raise WrongTypeError(f"parameter {described.name} is {number}; there are {listed}")
        return described.choices[number]
    return bool(number) if described.type == "bool" else number
