"""Topics of a log as columns over time, and the parameters of the flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from flight_log.attached import json_value
from flight_log.columns.log_columns import read_topics
from flight_log.reader import read_attachments
from flight_log.run import Series
from quadrotor.errors import LogFormatError
from quadrotor.parameter_description import ParameterValue


def read_columns(
    log: Path, vehicle: str, wanted: Mapping[str, tuple[str, ...]], optional: tuple[str, ...] = ()
) -> dict[str, Series]:
    """Return the fields of each topic, named without namespace, by the stamps of their source (s).

    Args:
        optional: topics that may be missing; they are returned without messages.

    Raises LogFormatError for other missing topics.
    """
    found = read_topics(log, vehicle, wanted)
    missing = [name for name, topic in found.items() if not len(topic) and name not in optional]
    if missing:
        raise LogFormatError(
            f"{log.name} has no messages of {', '.join(missing)} of {vehicle}: "
            "it cannot be judged without them"
        )
    return {
        name: Series(topic, topic.publish_ns.astype(float) * 1e-9) for name, topic in found.items()
    }


@dataclass(frozen=True, slots=True)
class FlownParameters:
    """The parameters at the beginning of a log.

    Attributes:
        vehicle: its own parameters.
        truth: those of the simulator, without prefix; empty when the log has none, as on a real
            vehicle.
    """

    vehicle: dict[str, ParameterValue]
    truth: dict[str, ParameterValue]


def read_parameters(log: Path) -> FlownParameters:
    """Read the parameters of a simulated flight, or of a station's run. Raises LogFormatError when
    they are missing.
    """
    try:
        values = json_value(read_attachments(log).get("parameters.json", b"{}"))
    except ValueError as error:
        raise LogFormatError(f"{log.name}: its parameters cannot be read: {error}") from None
    if isinstance(values, dict) and isinstance(values.get("vehicle"), dict):
        values = values["vehicle"]
    if not isinstance(values, dict) or "model.mass" not in values:
        raise LogFormatError(f"{log.name} has no parameters of the vehicle in it")
    prefix = "simulator."
    truth = {k.removeprefix(prefix): v for k, v in values.items() if k.startswith(prefix)}
    return FlownParameters(values, truth)
