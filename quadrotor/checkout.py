"""The place of this copy of quadlab: a checkout, or the package `quadlab` that a wheel installs.

A wheel has every package of a checkout below `quadlab` (docs/decisions/0001).
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""Folder of the packages, and of `examples` and `firmware`."""
PREFIX = "quadlab." if __name__.startswith("quadlab.") else ""
"""What precedes the name of each package: nothing in a checkout, "quadlab." in a wheel."""
IMPORTED_FROM = ROOT.parent if PREFIX else ROOT
"""Folder of `sys.path` from which this copy is imported."""
PACKAGES = (
    "quadrotor",
    "control",
    "estimation",
    "bearing_sim",
    "vehicle_link",
    "flight_log",
    "vehicle",
    "console",
    "web",
)
"""The packages that a wheel puts below `quadlab`."""
RUN_MODULE = (sys.executable, *(("-P",) if PREFIX else ()), "-m")
"""Command that runs a module of this copy, when followed by its name. In a wheel the current
folder must not be searched: it may be a checkout."""


@cache
def cache_folder(name: str) -> Path:
    """Return a folder next to Python's compiled files; in the user's cache for a wheel, which is
    removed without it, and where it cannot be written.
    """
    folder = ROOT / "__pycache__" / name
    try:
        if not PREFIX:
            folder.mkdir(parents=True, exist_ok=True)
            return folder
    except OSError:
        pass
    import platformdirs

    return platformdirs.user_cache_path("quadlab") / name
