"""The plugins of one kind that there are: files of a folder, and those of installed packages."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache
from pathlib import Path

from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.packaged_files import packaged
from vehicle.plugins.contract import KINDS, Contract
from vehicle.plugins.formats import endings, format_of
from vehicle.plugins.links import Link, NoLink, ProcessLink

TESTS = "test_"
"""Files that begin so are tests of plugins."""


class Plugins:
    """The plugins of one kind.

    Args:
        folder: of files NAME.py, and of the formats that extensions add; may be missing.
        waits: whether simulated time waits for their answers.
        taken: names that no plugin may have.
    """

    def __init__(
        self, contract: Contract, folder: Path | None, waits: bool, taken: Collection[str]
    ) -> None:
        self.folder, self.waits = folder, waits
        self._endings = endings(contract.kind)
        self._contract, self._taken = contract, taken
        # Once: it reads many files, which is too slow in flight.
        self._packaged = packaged(contract.group)

    def names(self) -> tuple[str, ...]:
        """Return the names of all."""
        return tuple(sorted(self.sources()))

    def check(self, parameter: str, name: str) -> None:
        """Raise RefusedError when more than one has this name."""
        sources = self.sources().get(name, [])
        if len(sources) > 1:
            raise RefusedError(
                f"{parameter} = {name}: two files or packages have this name, "
                f"{' and '.join(Path(one).name for one in sources)}; rename one"
            )

    def start(self, name: str) -> Link:
        """Return the link to the process of a plugin, which is starting; one that cannot start
        has failed already.
        """
        sources = self.sources().get(name)
        if sources is None:
            return NoLink(f"no {self._contract.kind} is called {name!r}")
        try:
            return ProcessLink(self._contract, sources[0], self.waits)
        except QuadlabError as error:
            return NoLink(str(error))

    def sources(self) -> dict[str, list[str]]:
        """Return the sources that `vehicle.plugins.host.load` takes, by the name of the plugin."""
        found: dict[str, list[str]] = {}
        folder, contract = self.folder, self._contract
        for path in sorted(folder.iterdir()) if folder is not None and folder.is_dir() else ():
            fits = path.suffix in self._endings and path.stem.isidentifier()
            if fits and not path.stem.startswith(("_", TESTS)) and contract.kind in _kinds(path):
                found.setdefault(path.stem, []).append(str(path))
        for point in self._packaged:
            found.setdefault(point.name, []).append(f"{contract.group}={point.value}")
        return {name: files for name, files in found.items() if name not in self._taken}


def _kinds(path: Path) -> Collection[str]:
    """Return what a file is: the kinds that it seems to define, a law when it defines none."""
    try:
        return _kinds_at(path, path.stat().st_mtime_ns)
    except OSError:  # told when it is chosen
        return KINDS[:1]


@lru_cache
def _kinds_at(path: Path, changed_ns: int) -> Collection[str]:
    if (other := format_of(path)) is not None:
        return (other.kind_of(path),)
    text = path.read_text(errors="replace")
    found = [
        kind
        for kind in KINDS
        if re.search(
            rf"^((class|def) +{kind}\b|{kind}\b.*=|(from|import)\b.*\b{kind}\b)", text, re.M
        )
    ]
    return found or KINDS[:1]
