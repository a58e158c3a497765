"""The budget of the source tree: figures that may fall, and rise with a reason only.

`budget.toml` has one line for each figure, `name = limit`, or for a limit that was raised
`name = { limit = N, reason = "why" }`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from quadrotor.errors import UsageError

PATH = Path(__file__).with_name("budget.toml")
FIXED = frozenset({"extensions"})
"""Figures whose limit stays, because what leaves core comes to them."""


def read_budget(path: Path = PATH) -> dict[str, int]:
    """Return the limit of each figure by its name.

    Raises UsageError for a limit that is none, or that was raised without a reason.
    """
    try:
        lines = tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: {error}") from error
    return {name: _limit(path, name, given) for name, given in lines.items()}


def _limit(path: Path, name: str, given: Any) -> int:
    match given:
        case int() if not isinstance(given, bool):
            return given
        case {"limit": int() as limit, "reason": str() as reason} if reason.strip():
            return limit
    raise UsageError(
        f'{path}: {name} is {given}; allowed are N, and {{ limit = N, reason = "why it rose" }}'
    )


def excesses(figures: Mapping[str, int], budget: Mapping[str, int], path: Path = PATH) -> list[str]:
    """Return one line for each figure above its limit, or without a limit or a figure."""
    lines = [
        f"{name} is {figures[name]}, above its limit of {limit} in {path}: lower it, or raise the "
        "limit with a reason"
        for name, limit in budget.items()
        if name in figures and figures[name] > limit
    ]
    lines += [f"{name} is no figure; remove it from {path}" for name in budget.keys() - figures]
    lines += [f"{name} has no limit in {path}" for name in sorted(figures.keys() - budget.keys())]
    return lines


def lowered(figures: Mapping[str, int], path: Path = PATH) -> int:
    """Lower the limits in the file to these figures, but those of FIXED; return how many changed.

    A limit that was raised loses its reason when its figure is lower again.
    """
    budget, changed, lines = read_budget(path), 0, []
    for line in path.read_text(encoding="utf-8").splitlines():
        name = line.partition("=")[0].strip().strip('"')
        if name not in FIXED and figures.get(name, limit := budget.get(name, 0)) < limit:
            lines.append(f'"{name}" = {figures[name]}')
            changed += 1
        else:
            lines.append(line)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return changed
