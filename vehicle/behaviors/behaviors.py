"""The behavior of the user's own that `external` flies: chosen by `behavior.plugin`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from control.behaviors.behavior import ExternalReference
from control.behaviors.parameters import NONE
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle.behaviors.external import ExternalBehavior
from vehicle.behaviors.offer import plugins_of

PARAMETER = "behavior.plugin"


class OwnBehaviors:
    """The plugins of a folder and of packages, and the process of the one that is chosen.

    Args:
        folder: of files NAME.py; may be missing.
        waits: whether simulated time waits for the answers.
        outside: the references that the behavior `external` flies.
        chosen: the first one.

    Raises RefusedError when there is none of this name.

    Attributes:
        external: the one in use; None while references come from a topic.
    """

    def __init__(
        self, folder: Path | None, waits: bool, outside: ExternalReference, chosen: str = NONE
    ) -> None:
        self._plugins = plugins_of(folder, waits)
        self._outside = outside
        self._name = NONE
        self.external: ExternalBehavior | None = None
        self.check({PARAMETER: chosen}, armed=False)

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError for a behavior that is not there, and for a change in flight."""
        name = str(values.get(PARAMETER, self._name))
        if name in (self._name, NONE):
            return
        names = self._plugins.names()
        if name not in names:
            raise RefusedError(
                f"{PARAMETER} = {name!r} is not a behavior; there are "
                f"{', '.join((NONE, *names))}; put NAME.py into "
                f"{self._plugins.folder or 'the folder plugins'}"
            )
        self._plugins.check(PARAMETER, name)
        if armed:
            raise RefusedError(f"{PARAMETER} is chosen on the ground: land and disarm first")

    def configure(self, name: str) -> None:
        """Start the process of this one, unless it runs; end that of another."""
        if name == self._name:
            return
        self.close()
        self._name = name
        self._outside.begin()
        if name != NONE:
            link, waits = self._plugins.start(name), self._plugins.waits
            self.external = ExternalBehavior(name, link, waits, self._outside)

    def close(self) -> None:
        """End the process."""
        if self.external is not None:
            self.external.close()
            self.external = None
