"""The place of this copy of quadlab: a checkout, or the package `quadlab` that a wheel installs.

A wheel has every package of a checkout below `quadlab` (docs/decisions/0001).
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""Folder of the packages, and of `examples` and `firmware`."""
PREFIX = "quadlab." if __name__.startswith("quadlab.") else ""
"""Prefix of the name of each package: nothing in a checkout, "quadlab." in a wheel."""
IS_VEHICLE_S = not (ROOT / "console").is_dir()
"""True if this copy is the vehicle's part alone, without station and page (docs/decisions/0001)."""
DISTRIBUTION = "quadlab-vehicle" if IS_VEHICLE_S else "quadlab"
"""The name under which this copy is installed."""
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
    "extensions",
)
"""The packages that a wheel puts below `quadlab`."""
RUN_MODULE = (sys.executable, *(("-P",) if PREFIX else ()), "-m")
"""Command that runs a module of this copy, when followed by its name. In a wheel the current
folder must not be searched: it may be a checkout."""
