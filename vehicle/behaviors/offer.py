"""The names of the behaviors of the user's own, as values of the vehicle's parameters."""

from __future__ import annotations

from pathlib import Path

from control.behaviors.parameters import NONE, BehaviorParameters
from quadrotor.parameters import offer_choices
from vehicle.behaviors.contract import BEHAVIOR
from vehicle.plugins.plugins import Plugins


def plugins_of(folder: Path | None, waits: bool = True) -> Plugins:
    """Return the behaviors that are plugins.

    Args:
        folder: of files NAME.py; may be missing.
        waits: whether simulated time waits for their answers.
    """
    return Plugins(BEHAVIOR, folder, waits, (NONE,))


def offer_behaviors(folder: Path | None) -> None:
    """Make their names values of `behavior.plugin`, before a tree's store is made."""
    offer_choices(BehaviorParameters, "plugin", (NONE, *plugins_of(folder).names()))
