"""The vehicles that the station of a data folder dials, for the page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from quadrotor.errors import StorageError

FILE = "station.json"


def remember_dialled(data: Path, names: Sequence[str]) -> None:
    """Write the names of the dialled vehicles. Raises StorageError."""
    part = data / f".{FILE}.part"
    try:
        part.write_text(json.dumps({"vehicles": list(names)}))
        part.replace(data / FILE)
    except OSError as error:
        raise StorageError(f"cannot write {data / FILE}: {error.strerror or error}") from error


def dialled(data: Path) -> tuple[str, ...]:
    """Return the vehicles of the station's newest start; empty when there was none."""
    with suppress(OSError, ValueError, TypeError, KeyError):
        names = json.loads((data / FILE).read_text())["vehicles"]
        return tuple(name for name in names if isinstance(name, str))
    return ()
