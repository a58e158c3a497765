"""Files that installed packages offer under a group of entry points, found without imports."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path


def packaged_files(group: str) -> dict[str, Path]:
    """Return the file of the module that each entry point of a group names, by the point's name.

    Nothing of a package is run. Modules that are not there, or not of Python, are left out.
    """
    found = {point.name: _module_file(point) for point in entry_points(group=group)}
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
