"""The sensors of the user's own that one vehicle reads: those that `estimation.sensors` names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from estimation.parameters import NO_SENSORS
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import OWN_SENSORS, Record
from vehicle.estimators.navigation import Navigation
from vehicle.plugins.plugins import Plugins
from vehicle.sensors.contract import SENSOR
from vehicle.sensors.external import ExternalSensor

PARAMETER = "estimation.sensors"


class OwnSensors:
    """The sensor plugins of a folder and of packages, and the processes of the chosen ones.

    Args:
        folder: of files NAME.py; may be missing.
        waits: whether simulated time waits for the answers.
        chosen: the value of the parameter to begin with.

    Raises RefusedError when one of them is not there.

    Attributes:
        externals: those in use.
    """

    def __init__(self, folder: Path | None, waits: bool, chosen: str = NO_SENSORS) -> None:
        self._plugins = Plugins(SENSOR, folder, waits, (NO_SENSORS,))
        self.externals: tuple[ExternalSensor, ...] = ()
        self.check({PARAMETER: chosen}, armed=False)

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError for a sensor that is not there, and one that is added in flight."""
        if PARAMETER not in values:
            return
        wanted = _names_of(str(values[PARAMETER]))
        there = self._plugins.names()
        running = [one.name for one in self.externals]
        for name in wanted:
            if name not in there:
                raise RefusedError(
                    f"{PARAMETER}: {name!r} is not a sensor; there are "
                    f"{', '.join((NO_SENSORS, *there))}; put NAME.py into "
                    f"{self._plugins.folder or 'the folder plugins'}"
                )
            self._plugins.check(PARAMETER, name)
            if armed and name not in running:
                raise RefusedError(f"{PARAMETER}: {name} is added on the ground: disarm first")
        if len(wanted) > OWN_SENSORS:
            raise RefusedError(
                f"{PARAMETER} names {len(wanted)} sensors; {OWN_SENSORS} run at a time"
            )

    def configure(self, chosen: str) -> None:
        """Start the processes of these sensors, unless they run; end all other processes."""
        wanted = _names_of(chosen)
        running = {one.name: one for one in self.externals}
        if list(running) == wanted:
            return
        for name in running.keys() - set(wanted):
            running[name].close()
        plugins = self._plugins
        taken = {running[name].place for name in wanted if name in running}
        free = iter(sorted(set(range(1, OWN_SENSORS + 1)) - taken))
        self.externals = tuple(
            running.get(name)
            or ExternalSensor(name, plugins.start(name), plugins.waits, next(free))
            for name in wanted
        )

    def step(
        self,
        stamp_ns: int,
        dt: float,
        imu: Record,
        state: Record,
        pressure: float,
        flying: bool,
        navigation: Navigation,
    ) -> None:
        """Apply their readings to all running filters that take them; called in each tick."""
        for one in self.externals:
            filters = navigation.running.everything()
            one.step(stamp_ns, dt, imu, state, pressure, flying, estimators=filters)

    def judged(self) -> list[Record]:
        """Return the readings of the newest tick, JUDGED_READING (1,) each, for the log."""
        return [reading for one in self.externals for reading in one.judged]

    def without(self, failed: ExternalSensor) -> str:
        """Return the parameter's value without one of them."""
        return " ".join(e.name for e in self.externals if e is not failed) or NO_SENSORS

    def close(self) -> None:
        """End the processes."""
        for one in self.externals:
            one.close()
        self.externals = ()


def _names_of(value: str) -> list[str]:
    """Return the names in a value of the parameter, in order and each once."""
    return [name for name in dict.fromkeys(value.replace(",", " ").split()) if name != NO_SENSORS]
