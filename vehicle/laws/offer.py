"""The names of the control laws that one vehicle may fly, as values of its parameters."""

from __future__ import annotations

from pathlib import Path

from control import laws
from control.laws import extended
from control.parameters import NONE
from vehicle.laws.contract import LAW
from vehicle.plugins.links import UDP
from vehicle.plugins.plugins import Plugins


def plugins_of(folder: Path | None, waits: bool = True) -> Plugins:
    """Return the laws that are plugins.

    Args:
        folder: of files NAME.py and NAME.fmu; may be missing.
        waits: whether simulated time waits for the answers of a plugin.
    """
    return Plugins(LAW, folder, waits, (*laws.BUILT_IN, *extended(), UDP, NONE))


def others_of(plugins: Plugins) -> tuple[str, ...]:
    """Return the names of the laws that are not built in."""
    return (*extended(), UDP, *plugins.names())


def offer_laws(folder: Path | None) -> None:
    """Make the names of all laws values of the parameters, before a tree's store is made."""
    laws.offer(others_of(plugins_of(folder)))
