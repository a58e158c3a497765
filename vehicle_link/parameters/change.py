"""A change of a parameter as its authority reports it."""

from __future__ import annotations

import msgspec

from quadrotor.parameters import ParameterValue


class ParameterChange(msgspec.Struct, frozen=True, tag="parameter_change"):
    """A change that an authority has applied.

    Attributes:
        instance: of the process that counts the revisions; 0 if unknown.
    """

    stamp_ns: int
    name: str
    old: ParameterValue
    new: ParameterValue
    requester: str
    revision: int
    instance: int = 0
