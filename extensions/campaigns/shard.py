"""The parts into which a campaign is divided for the jobs of an array."""

from __future__ import annotations

import re
from dataclasses import dataclass

from quadrotor.errors import UsageError


@dataclass(frozen=True)
class Shard:
    """The flights whose index is `number - 1` modulo `of`: one of the parts of a campaign."""

    number: int = 1
    of: int = 1

    @property
    def name(self) -> str:
        return f"{self.number}of{self.of}"

    def indices(self, flights: int) -> range:
        return range(self.number - 1, flights, self.of)


WHOLE = Shard()


def parse_shard(text: str) -> Shard:
    """Return the shard of I/N. Raises UsageError."""
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise UsageError(f"--shard {text}: write I/N with I from 1 to N, as 1/4, 2/4, 3/4, 4/4")
    return Shard(int(found[1]), int(found[2]))
