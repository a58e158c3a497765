"""Flights by `quadlab fly`, whose report several tests may share."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from typing import Any

from quadlab.__main__ import main


def flown(out: Path, *words: str) -> dict[str, Any]:
    """Fly the experiment of these words; return the report, whose log is in `out`."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        main(["fly", *words, "--out", str(out), "--json"])
    report: dict[str, Any] = json.loads(printed.getvalue().strip().splitlines()[-1])
    return report


def sets(*settings: str) -> list[str]:
    """Return the words that set these parameters, each NAME=VALUE."""
    return [word for one in settings for word in ("--set", one)]
