"""Values that a log carries as text: attached JSON, and parameters as Python writes them.

Whoever made the file wrote them, so whatever cannot be read is a ValueError, also what is nested
deeper than the interpreter's stack.
"""

from __future__ import annotations

import ast
import json
from typing import Any

LONGEST = 100_000
"""Characters of one parameter's value; the largest layout of beacons has a tenth of it."""


def json_value(data: bytes | str) -> Any:
    """Raise ValueError when it is no JSON."""
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def literal_value(text: str) -> Any:
    """Return the number, truth or text that `repr` wrote. Raise ValueError for anything else."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters are no parameter's value")
    try:
        return ast.literal_eval(text)
    except (SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(str(error) or "it is nested too deep") from None
