"""Additions of plugins to the parameters of a vehicle."""

from __future__ import annotations

from pathlib import Path

from vehicle.estimators.estimators import Estimators
from vehicle.plugins import declared


def offer_plugins(folder: Path | None) -> list[str]:
    """Make the names of estimators values of the parameters, and the parameters that plugins
    declare part of them, before a tree's store is made.

    Returns a line for each file whose parameters cannot be read.
    """
    Estimators(folder).offer()
    return declared.offer(folder)
