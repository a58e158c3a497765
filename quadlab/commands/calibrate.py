"""`quadlab calibrate [NAME]`: a guided calibration through the station on this machine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from console.experiments.catalogue import experiments
from quadlab.option_types import Flag, Settings
from quadlab.vehicle_names import check_name
from quadrotor.errors import ParameterError, UsageError
from quadrotor.similar_names import did_you_mean

if TYPE_CHECKING:
    from quadlab.station_client import StationClient
    from vehicle_link.messages.records import ExperimentResponse

_CALIBRATIONS = [name for name, one in experiments().items() if one.offer.calibration]
CALIBRATION = f"{', '.join(_CALIBRATIONS)}, or one from your own file"


@dataclass
class Calibrate:
    """Calibrate the vehicle of the running station; without a name, print the calibrations in
    force.
    """

    calibration: Annotated[
        str | None,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="NAME", help=CALIBRATION, help_behavior_hint=""),
    ] = None
    set: Settings = ()
    """an option of the calibration"""
    yes: Flag = False
    """answer yes to every question: propellers are off, the vehicle is fixed, …"""
    accept: Flag = False
    """accept a result within its limits without asking"""
    reject: Flag = False
    """reject the result without asking; nothing on the vehicle changes"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback; --link-port of `quadlab up`"""
    name: str = "quad1"
    """namespace of the vehicle's topics"""

    def run(self) -> int:
        from quadlab.calibration.dialogue import CalibrationRequest, Dialogue
        from quadlab.calibration.screen import Screen
        from quadlab.station_client import station

        check_name(self.name)
        if self.accept and self.reject:
            raise UsageError("--accept and --reject: give one of them")
        if self.calibration is None and (self.set or self.yes or self.accept or self.reject):
            raise UsageError("these options need a calibration: quadlab calibrate NAME …")
        screen = Screen()
        if self.calibration and not screen.is_terminal and not (self.accept or self.reject):
            raise UsageError(
                "there is no terminal to answer on: give --accept or --reject, and --yes to "
                "confirm its questions"
            )
        with station(self.loopback_port, self.name) as client:
            reply = client.ask("experiment", action="describe")
            if self.calibration is None:
                return _list(client, reply)
            wanted = CalibrationRequest(
                self.calibration, self._options(reply), self.yes, self.accept, self.reject
            )
            return Dialogue(client, screen, wanted).run()

    def _options(self, reply: ExperimentResponse) -> dict[str, Any]:
        """Return the options, checked against those of the station. Raises UsageError."""
        from quadrotor.parameter_description import parse_text
        from vehicle_link.parameters.messages import from_descriptor

        known = dict(zip(reply.names, reply.problems, strict=True))
        name = self.calibration or ""
        if name not in known or not dict(zip(reply.names, reply.calibrations, strict=True))[name]:
            if known.get(name):
                raise UsageError(f"{name} cannot run: {known[name]}")
            there = [n for n, record in zip(reply.names, reply.calibrations, strict=True) if record]
            hint = did_you_mean(name, there, after=" ")
            raise UsageError(f"no calibration {name!r:.60}; {hint}known are {', '.join(there)}")
        options = {one.name: one for one in map(from_descriptor, reply.descriptors)}
        values = {}
        for word in self.set:
            option, equals, text = word.partition("=")
            if not equals:
                raise UsageError(f"--set {word}: write it as NAME=VALUE")
            if f"{name}.{option}" not in options:
                there = [o.split(".", 1)[1] for o in options if o.startswith(f"{name}.")]
                raise UsageError(
                    f"--set {word}: {name} has no option {option!r}; "
                    + (f"there are {', '.join(there)}" if there else "it has none")
                )
            try:
                values[option] = parse_text(options[f"{name}.{option}"], text)
            except ParameterError as error:
                raise UsageError(f"--set {word}: {error}") from None
        return values


def _list(client: StationClient, reply: ExperimentResponse) -> int:
    from quadlab.calibration.dialogue import in_force
    from quadlab.calibration.lines import listed

    names = zip(reply.names, reply.calibrations, strict=True)
    calibrations = {str(name): str(record) for name, record in names if record}
    for line in listed(calibrations, in_force(client)):
        print(line)
    for name, problem in zip(reply.names, reply.problems, strict=True):
        if problem:
            print(f"{name} cannot run: {problem}")
    return 0
