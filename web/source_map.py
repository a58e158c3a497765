"""Source maps, version 3: for each line of a joined script, its file and line."""

from __future__ import annotations

import json
from collections.abc import Iterable
from itertools import pairwise

_DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"


def source_map(names: Iterable[str], places: list[tuple[int, int] | None], place: str) -> str:
    """Return a source map, version 3.

    Each line of the script is a line of a file, or belongs to no file.
    """
    known = [(0, 0), *(one for one in places if one is not None)]
    steps = iter([(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(known)])
    mappings = []
    for one in places:
        if one is None:
            mappings.append("")
            continue
        file, line = next(steps)
        mappings.append("A" + _vlq(file) + _vlq(line) + "A")
    return json.dumps(
        {
            "version": 3,
            "sources": [f"{place}{name}" for name in names],
            "names": [],
            "mappings": ";".join(mappings),
        }
    )


def _vlq(value: int) -> str:
    """Encode an integer in base 64, five bits a digit, with the sign in the lowest bit."""
    rest, digits = (-value << 1 | 1) if value < 0 else value << 1, ""
    while True:
        digit, rest = rest & 31, rest >> 5
        digits += _DIGITS[digit | 32 if rest else digit]
        if not rest:
            return digits
