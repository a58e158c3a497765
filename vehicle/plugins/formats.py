"""Formats of plugins' files beside Python, which extensions offer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from quadrotor.extension import PluginFormat
from quadrotor.extensions import Offered, registry
from quadrotor.parameters import Parameters
from vehicle.plugins.contract import Contract


class Format(Protocol):
    """The functions that read the files of a format."""

    def kind_of(self, path: Path) -> str:
        """Return the kind of plugin that a file is, as "law"; of an unreadable file too."""
        ...

    def declared(self, path: Path) -> Parameters | None:
        """Return the file's parameters, None when it has none. Raises UsageError."""
        ...

    def load(self, contract: Contract, path: Path) -> object:
        """Return the plugin, in its own process. Raises UsageError."""
        ...


@lru_cache(maxsize=1)
def _formats() -> Mapping[str, Offered[PluginFormat]]:
    return registry().offers(PluginFormat, taken=(".py",))


def endings(kind: str) -> tuple[str, ...]:
    """Return the endings of files that can be plugins of a kind."""
    return ".py", *(name for name, one in _formats().items() if kind in one.offer.plugins)


def format_of(path: Path) -> Format | None:
    """Return the format of a file, None for Python. Raises UsageError if it cannot be imported."""
    offered = _formats().get(path.suffix)
    found: Format | None = offered.load() if offered is not None else None
    return found
