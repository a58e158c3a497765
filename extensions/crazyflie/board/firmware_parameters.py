"""The parameters of a Crazyflie's firmware that its options name, as parameters of the vehicle."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from extensions.crazyflie.board.options import CrazyflieOptions
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, ParameterStore, parameter, parameters_of
from vehicle.boards.offered import FIRMWARE

NAMES = {
    **{"b": "int8_t", "h": "int16_t", "i": "int32_t", "q": "int64_t", "f": "float"},
    **{"B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t", "d": "double"},
}
"""Types in C by their letter of `struct`."""
EXACT = 2.0**53
"""The whole number up to which a page is exact, where bounds of 64 bits end."""


class FirmwareParameters:
    """The firmware's parameters that the options name, with the values that it has confirmed.

    The newest change of a parameter counts, in `parameters` or of `firmware` itself.
    """

    def __init__(self, options: CrazyflieOptions) -> None:
        self._options = options
        self._shown = ParameterStore(options.firmware)
        self._text, self._given = "", dict[str, float]()
        self._sent: dict[str, float] = {}
        self._known = self._shown_values()

    def _shown_values(self) -> dict[str, float]:
        return {name: float(value) for name, value in self._shown.values().items()}

    def all(self) -> dict[str, float]:
        """Return {name: value} of everything that a start sets."""
        self._text, self._given = self._options.parameters, self._options.wanted
        self._sent = self._shown_values()
        return self._given | self._sent

    def changes(self) -> dict[str, float]:
        """Return {name: value} of the changes since the last call of this method or of `all`."""
        found: dict[str, float] = {}
        if self._options.parameters != self._text:
            before = self._given
            self._text, self._given = self._options.parameters, self._options.wanted
            found |= {n: value for n, value in self._given.items() if before.get(n) != value}
        sent, self._sent = self._sent, self._shown_values()
        return found | {n: v for n, v in self._sent.items() if v not in (sent[n], self._known[n])}

    def is_of_text(self, name: str) -> bool:
        """Return whether the newest change of this parameter was in `parameters`."""
        return self._sent.get(name) == self._known.get(name)

    def confirm(self, values: Mapping[str, float]) -> dict[str, ParameterValue]:
        """Note the values that the Crazyflie confirmed.

        Returns the values of the vehicle's parameters that must follow, by their full names.
        """
        self._known |= {n: shortest(value) for n, value in values.items() if n in self._known}
        return {
            FIRMWARE + name: self._known[name]
            for name, sent in self._sent.items()
            if self._shown.get(name) == sent != self._known[name]
        }


def describe(
    named: Mapping[str, tuple[struct.Struct, float]], wanted: Mapping[str, float]
) -> Parameters:
    """Return the parameters that are shown, with a component for each group, at their values.

    Args:
        named: {GROUP.NAME: (layout, value)} as read.
        wanted: values that each start sets, whatever was read.
    """
    groups: dict[str, Any] = {}
    for full, (form, value) in named.items():
        group, _, name = full.partition(".")
        if all(word.isidentifier() and not hasattr(Parameters, word) for word in (group, name)):
            field = _field(form.format[-1], wanted.get(full, value))
            groups.setdefault(group, {})[name] = field
    for group, fields in groups.items():
        made = parameters_of(Parameters, group, fields)
        groups[group] = made, made()
    return parameters_of(Parameters, "Firmware", groups)()


def _field(letter: str, value: float) -> tuple[type, object]:
    if letter in "fd":
        high = float(np.finfo(np.dtype(letter)).max)
        low, shown = -high, shortest(value)
        step = 10.0 ** (math.floor(math.log10(abs(shown) or 1.0)) - 2)
    else:
        bits = 8 * struct.calcsize(letter) - letter.islower()
        high = min(2.0**bits - 1.0, EXACT)
        low, shown, step = -high - 1.0 if letter.islower() else 0.0, int(value), 1.0
    description = f"{NAMES[letter]} of the Crazyflie, as it has confirmed it"
    return type(shown), parameter(shown, ge=low, le=high, step=step, description=description)


def shortest(value: float) -> float:
    """Return the number with the fewest digits that is the same as a float of the firmware."""
    single = np.float32(value)
    return float(str(single)) if single == value else value
