"""The control laws there are: built in, of extensions, over UDP, files of a folder, packages'."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from control.controller import GeometricController
from control.laws import extended
from control.near_hovering import NearHoveringController
from control.parameters import GEOMETRIC, NEAR_HOVERING, NONE, ControlParameters
from quadrotor.errors import QuadlabError, RefusedError
from vehicle.laws.compiled import CompiledController
from vehicle.laws.contract import LAW as CONTRACT
from vehicle.laws.external import ExternalLaw
from vehicle.laws.offer import others_of, plugins_of
from vehicle.plugins.links import UDP, NoLink, udp_link

BUILT_IN: dict[str, Callable[[], GeometricController]] = {
    GEOMETRIC: partial(GeometricController, leads=True),
    NEAR_HOVERING: NearHoveringController,
}
LAW, SHADOW_LAW = "control.law", "control.shadow_law"


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
        self._extended, self._plugins = extended(), plugins_of(folder, waits)

    def names(self) -> tuple[str, ...]:
        """Return the names of all laws, built-in ones first."""
        return (*BUILT_IN, *others_of(self._plugins))

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
                    f"put NAME.py or NAME.fmu into {self._plugins.folder or 'the folder plugins'}"
                )
            self._plugins.check(parameter, name)
        if law not in BUILT_IN and shadow not in (NONE, law):
            raise RefusedError(
                f"{SHADOW_LAW} = {shadow} next to {LAW} = {law}: one external law runs at a "
                f"time; set one of them to {NONE} or {GEOMETRIC}"
            )

    def start(
        self, name: str, base: GeometricController, control: ControlParameters
    ) -> ExternalLaw:
        """Return the law, compiled, or with its process starting; one that cannot start has failed
        already.
        """
        waits, bounds = self._plugins.waits, control.plugin
        if name in self._extended:
            try:
                return CompiledController(name, self._extended[name].load(), base, control)
            except Exception as error:  # code of others, or a law that cannot be compiled
                return ExternalLaw(name, NoLink(_told(error)), base, waits)
        if name == UDP:
            link = udp_link(CONTRACT, "control.plugin", bounds.udp_peer, bounds.udp_port, waits)
        else:
            link = self._plugins.start(name)
        return ExternalLaw(name, link, base, waits)


def _told(error: Exception) -> str:
    if isinstance(error, QuadlabError):
        return str(error)
    return f"{type(error).__name__}: {error}".splitlines()[0]
