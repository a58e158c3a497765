"""The exchange with a plugin: an input in each tick, its answer in the next."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle.plugins.contract import Contract
from vehicle.plugins.host import message_of
from vehicle.plugins.links import Link

CONSECUTIVE, SHARE, MEMORY = 25, 0.2, 1.0 / 500.0
"""Ticks without an answer after which a plugin is disengaged: that many in a row, or this share of
them; MEMORY is the weight of one tick in the share."""
READ_AT_ONCE = 32
"""Answers read in one tick: a flood must not delay the motors."""


class External:
    """A plugin that one vehicle runs; `failure` becomes the reason once it must not be used any
    more.

    Args:
        waits: whether time waits for an answer: one that is missing then ends the plugin.

    Attributes:
        flown: whether the answer is flown; otherwise it is only compared.
        is_ready: whether it is loaded. failure: why it is out, empty while it is not.
        ticks, missed: inputs since the last summary, and those without an answer in time.
    """

    def __init__(self, contract: Contract, name: str, link: Link, waits: bool) -> None:
        self.name, self.flown, self.failure, self.is_ready = name, False, "", False
        self._contract, self._link, self._waits = contract, link, waits
        self._out = np.zeros(1, contract.inputs)
        self._out["reset"] = 1.0
        self._asked = math.nan
        self.ticks = self.missed = self._in_a_row = 0
        self._share = self._squares = 0.0
        self._was_flying = self._is_told = False
        self._values: Mapping[str, ParameterValue] = {}
        self._given: Mapping[str, ParameterValue] = {}

    def becomes_ready(self) -> bool:
        """Return whether the plugin is loaded now and was not at the last call."""
        if self.is_ready or self.failure:
            return False
        try:
            self.is_ready = self._link.ready()
        except RefusedError as error:
            self.failure = str(error)
        return self.is_ready

    def news(self, flying: bool) -> list[str]:
        """Return lines about recent events: it was loaded, it landed."""
        self.becomes_ready()
        kind = self._contract.kind
        lines = [f"{kind} {self.name} is ready"] if self.is_ready > self._is_told else []
        self._is_told = self.is_ready
        if flying != self._was_flying:
            self._was_flying = flying
            has_flown, line = self.ticks and not flying, self.summary()
            lines += [line] if has_flown else []
        return lines

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        line = (
            f"{self._contract.kind} {self.name}: {self.missed} of {self.ticks} inputs without an "
            "answer in time"
        )
        self.ticks = self.missed = 0
        self._squares = 0.0
        return line

    @property
    def difference(self) -> float:
        """Return the rms difference from the built-in one, of the answers since the last
        summary."""
        answered = self.ticks - self.missed
        return math.sqrt(self._squares / answered) if answered else math.nan

    def give(self, values: Mapping[str, ParameterValue]) -> None:
        """Have the plugin's own parameters set before the next input, where they have changed."""
        self._values = values

    def close(self) -> None:
        """End its process."""
        self._link.close()

    # ------------------------------------------------------------------ parts
    def _ask(self) -> None:
        """Send the input, if it is loaded."""
        if self.is_ready:
            if self._values != self._given:
                self._link.send(message_of(self._contract, self._values))
                self._given = self._values
            self._link.send(self._out.tobytes())
            self._asked = self._out["time"].item()
            self._out["reset"] = 0.0

    def _answer(self) -> Record | None:
        """Return the answer to the last input, outputs (1,); None when there is none yet. Raises
        RefusedError when too many are missing."""
        if math.isnan(self._asked):
            return None
        self.ticks += 1
        for _ in range(READ_AT_ONCE):
            data = self._link.receive()
            if data is None:
                break
            if len(data) == self._contract.outputs.itemsize:
                answer = np.frombuffer(data, self._contract.outputs)
                if answer["time"].item() == self._asked:
                    self._in_a_row = 0
                    self._share -= MEMORY * self._share
                    return answer
        self.missed += 1
        self._in_a_row += 1
        self._share += MEMORY * (1.0 - self._share)
        if self._waits or self._in_a_row >= CONSECUTIVE or self._share > SHARE:
            raise RefusedError(
                f"no answer in time to {self._in_a_row} inputs in a row, "
                f"{self.missed} of {self.ticks} in all"
            )
        return None
