"""The control laws there are: built in, over UDP, files of a folder, and installed packages'."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path

from control.controller import GeometricController
from control.near_hovering import NearHoveringController
from control.parameters import GEOMETRIC, NEAR_HOVERING, NONE, PluginBounds
from quadrotor.errors import QuadlabError, RefusedError
from vehicle.laws.external import ExternalLaw
from vehicle.laws.host import FMU, GROUP
from vehicle.laws.links import Link, NoLink, ProcessLink, UdpLink

BUILT_IN: dict[str, Callable[[], GeometricController]] = {
    GEOMETRIC: GeometricController,
    NEAR_HOVERING: NearHoveringController,
}
LAW, SHADOW_LAW = "control.law", "control.shadow_law"
UDP = "udp"
TESTS = "test_"
"""Files that begin so are tests of laws."""


def base_of(name: str) -> str:
    """Return the built-in law that flies when the law of this name does not."""
    return name if name in BUILT_IN else GEOMETRIC


class Laws:
    """The laws that one vehicle may fly.

    Args:
        folder: of files NAME.py and NAME.fmu; may be missing.
        waits: whether simulated time waits for the answers of an external law.
    """

    def __init__(self, folder: Path | None = None, waits: bool = True) -> None:
        self._folder, self._waits = folder, waits
        self._packaged = entry_points(group=GROUP)  # once: it reads many files, too slow in flight

    def names(self) -> tuple[str, ...]:
        """Return the names of all laws, built-in ones first."""
        return (*BUILT_IN, UDP, *sorted(self._sources()))

    def check(self, law: str, shadow: str) -> None:
        """Raise RefusedError for a law that is not there, and for two external ones."""
        for parameter, name in ((LAW, law), (SHADOW_LAW, shadow)):
            if parameter == SHADOW_LAW and name == NONE:
                continue
            if parameter == SHADOW_LAW and name in BUILT_IN:
                raise RefusedError(f"{parameter} = {name} is built in; it always runs along")
            if name not in self.names():
                raise RefusedError(
                    f"{parameter} = {name!r} is not a law; there are {', '.join(self.names())}; "
                    f"put NAME.py or NAME.fmu into {self._folder or 'the folder plugins'}"
                )
            if len(self._sources().get(name, ())) > 1:
                raise RefusedError(
                    f"{parameter} = {name}: two files or packages have this name, "
                    f"{' and '.join(Path(one).name for one in self._sources()[name])}; rename one"
                )
        if law not in BUILT_IN and shadow not in (NONE, law):
            raise RefusedError(
                f"{SHADOW_LAW} = {shadow} next to {LAW} = {law}: one external law runs at a "
                f"time; set one of them to {NONE} or {GEOMETRIC}"
            )

    def start(self, name: str, base: GeometricController, bounds: PluginBounds) -> ExternalLaw:
        """Return the law, whose process is starting; one that cannot start has failed already."""
        link: Link
        try:
            if name == UDP:
                link = UdpLink(bounds.udp_peer, bounds.udp_port, self._waits)
            else:
                link = ProcessLink(self._sources()[name][0], self._waits)
        except QuadlabError as error:
            link = NoLink(str(error))
        return ExternalLaw(name, link, base, self._waits)

    def _sources(self) -> dict[str, list[str]]:
        """Return what `vehicle.laws.host.load` takes, by the name of the law."""
        found: dict[str, list[str]] = {}
        folder = self._folder
        for path in sorted(folder.iterdir()) if folder is not None and folder.is_dir() else ():
            is_law = path.suffix in (".py", FMU) and path.stem.isidentifier()
            if is_law and not path.stem.startswith(("_", TESTS)):
                found.setdefault(path.stem, []).append(str(path))
        for point in self._packaged:
            found.setdefault(point.name, []).append(f"{GROUP}={point.value}")
        return {name: files for name, files in found.items() if name not in (*BUILT_IN, UDP, NONE)}
