"""Entry points of installed packages, and the files that they name, found without imports."""

from __future__ import annotations

import sys
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points
from pathlib import Path
from typing import Any


def packaged(group: str) -> EntryPoints:
    """Return the entry points of a group."""
    found: EntryPoints = _found(tuple((path, _changed_ns(path)) for path in sys.path)).select(
        group=group
    )
    return found


@lru_cache(maxsize=1)
def _found(_: tuple[tuple[str, int], ...]) -> Any:
    """Return all entry points: they are in a file of each of a hundred packages."""
    return entry_points()


def _changed_ns(path: str) -> int:
    try:
        return Path(path or ".").stat().st_mtime_ns
    except OSError:
        return 0


def packaged_files(group: str) -> dict[str, Path]:
    """Return the file of the module that each entry point of a group names, by the point's name.

    Nothing of a package is run. Modules that are not there, or not of Python, are left out.
    """
    found = {point.name: _module_file(point) for point in packaged(group)}
    return {name: file for name, file in found.items() if file is not None}


def _module_file(point: EntryPoint) -> Path | None:
    name, places, found = "", None, None
    for part in point.module.split("."):
        name = f"{name}.{part}" if name else part
        specs = (finder.find_spec(name, places) for finder in sys.meta_path)
        found = next((spec for spec in specs if spec is not None), None)
        if found is None:
            return None
        places = found.submodule_search_locations
    origin = found.origin if found is not None else None
    return Path(origin) if origin is not None and origin.endswith(".py") else None
