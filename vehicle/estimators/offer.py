"""Additions of plugins to the parameters of a vehicle."""

from __future__ import annotations

from pathlib import Path

from estimation import names
from vehicle.behaviors.offer import offer_behaviors
from vehicle.estimators.contract import ESTIMATOR
from vehicle.laws.offer import offer_laws
from vehicle.plugins import declared
from vehicle.plugins.plugins import Plugins


def plugins_of(folder: Path | None, waits: bool = True) -> Plugins:
    """Return the estimators that are plugins.

    Args:
        folder: of files NAME.py and NAME.fmu; may be missing.
        waits: whether simulated time waits for the answers of a plugin.
    """
    return Plugins(ESTIMATOR, folder, waits, (*names.names(), names.NONE, names.UDP))


def offer_estimators(folder: Path | None = None) -> None:
    """Make the names of plugins values of the parameters, before a tree's store is made."""
    names.offer((names.UDP, *plugins_of(folder).names()))


def offer_plugins(folder: Path | None) -> list[str]:
    """Make the names of estimators, laws and behaviors values of the parameters, and the parameters
    that plugins declare part of them, before a tree's store is made.

    Returns a line for each file whose parameters cannot be read.
    """
    offer_estimators(folder)
    offer_laws(folder)
    offer_behaviors(folder)
    return declared.offer(folder)
