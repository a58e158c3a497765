"""The parameters of how long the vehicle keeps its own logs, and how much room it leaves."""

from __future__ import annotations

from collections.abc import Mapping

from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter

PREFIX = "log."


class OnboardLogParameters(Parameters):
    """The ring of onboard logs: the oldest closed one goes first, the newest never."""

    keep_days: float = parameter(90.0, unit="d", ge=1.0, le=3650.0, step=1.0)
    """older logs are removed at the start and after a flight, if the computer's clock is
    synchronised"""
    keep_size: float = parameter(20.0, unit="GB", ge=0.1, le=10000.0, step=1.0)
    """the oldest logs are removed while all together are larger"""
    keep_free: float = parameter(2000.0, unit="MB", ge=20.0, le=1000000.0, step=100.0)
    """the oldest logs are removed while less of the disk is free"""
    stop_free: float = parameter(500.0, unit="MB", ge=10.0, le=100000.0, step=10.0)
    """no log is written while less of the disk is free"""

    @property
    def stop_bytes(self) -> int:
        return round(1e6 * self.stop_free)


def log_parameters(values: Mapping[str, ParameterValue]) -> OnboardLogParameters:
    """Return the log's parameters from all of the vehicle's values by name."""
    own = {name.removeprefix(PREFIX): v for name, v in values.items() if name.startswith(PREFIX)}
    return OnboardLogParameters.model_validate(own)
