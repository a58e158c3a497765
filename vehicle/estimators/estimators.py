"""The estimators that one vehicle may fly on: those of `estimation.registry`, and plugins."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from estimation import registry
from estimation.names import NONE
from estimation.parameters import EstimationParameters
from quadrotor.errors import RefusedError
from vehicle.estimators.contract import ESTIMATOR as CONTRACT
from vehicle.estimators.estimator_runner import POSES, Runner
from vehicle.estimators.external import ExternalEstimator
from vehicle.estimators.offer import plugins_of
from vehicle.plugins.links import UDP, udp_link


class Estimators:
    """The estimators by name.

    Args:
        folder: of files NAME.py and NAME.fmu; may be missing.
        waits: whether simulated time waits for the answers of a plugin.
    """

    def __init__(self, folder: Path | None = None, waits: bool = True) -> None:
        self._plugins = plugins_of(folder, waits)

    def register(self) -> None:
        """Register the plugins like built-in ones, for programs that run estimators by name."""
        for name in self._plugins.names():
            registry.register(name, partial(self._external, name))

    def check(self, parameter: str, name: str) -> None:
        """Raise RefusedError for a name that more than one has, or none."""
        if name in (*registry.names(), NONE):
            return
        if name not in self._names():
            raise RefusedError(
                f"{parameter} = {name!r} is not an estimator; there are "
                f"{', '.join((*registry.names(), *self._names()))}; "
                f"put NAME.py or NAME.fmu into {self._plugins.folder or 'the folder plugins'}"
            )
        self._plugins.check(parameter, name)

    def start(self, name: str, source: str, parameters: EstimationParameters) -> Runner:
        """Return an estimator on its source; the process of a plugin is starting."""
        if name not in registry.names():
            return Runner(name, source, self._external(name, parameters, source))
        registry.prepare(name, source != POSES)  # does nothing when `check` has prepared it
        return Runner(name, source, registry.create(name, parameters))

    def _names(self) -> tuple[str, ...]:
        return UDP, *self._plugins.names()

    def _external(
        self, name: str, parameters: EstimationParameters, source: str = ""
    ) -> ExternalEstimator:
        plugins, source = self._plugins, source or parameters.source
        built_in = self.start(parameters.plugin.built_in, source, parameters)
        p = parameters.plugin
        if name == UDP:
            link = udp_link(CONTRACT, "estimation.plugin", p.udp_peer, p.udp_port, plugins.waits)
        else:
            link = plugins.start(name)
        own = ExternalEstimator(name, link, built_in, plugins.waits)
        own.configure(parameters)
        return own
