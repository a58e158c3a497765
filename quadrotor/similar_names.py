"""The question that follows a mistyped name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(
    name: str, known: Iterable[str], *, before: str = "", after: str = "", cutoff: float = 0.6
) -> str:
    """Return "did you mean A or B?" between `before` and `after`; "" if no known name is similar.

    Args:
        cutoff: smallest similarity, from 0 to 1, of `difflib.get_close_matches`.
    """
    near = difflib.get_close_matches(name, list(known), cutoff=cutoff)
    return f"{before}did you mean {' or '.join(near)}?{after}" if near else ""
