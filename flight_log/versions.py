"""Messages of other versions of quadlab: read by the fields that their log describes."""

from __future__ import annotations

from functools import cache
from typing import Any

from mcap.records import Schema

from flight_log.attached import literal_value
from quadrotor.errors import LogFormatError, UsageError, WrongTypeError
from quadrotor.parameters import ParameterValue
from vehicle_link.messages import stored_name, typestore
from vehicle_link.parameters.messages import from_value


def decodable_name(schema: Schema) -> str:
    """Return the type name with which `decode` reads the messages of this schema.

    It is the schema's own name unless the fields differ from those of this version.
    """
    return _decodable_name(schema.name, schema.data)


@cache
def _decodable_name(name: str, described: bytes) -> str:
    from rosbags.typesys import get_types_from_msg  # late: it takes a while
    from rosbags.typesys.base import TypesysError

    try:
        own = stored_name(name)
        found = get_types_from_msg(described.decode(), own)
    except (TypesysError, UsageError, ValueError):
        return name
    store = typestore()
    ours = store.fielddefs
    if own not in ours or list(found[own][1]) == list(ours[own][1]):
        return name
    other = f"{own}Version{sum(one.startswith(f'{own}Version') for one in ours)}"
    parts = {part: fields for part, fields in found.items() if part not in ours}
    store.register({**parts, other: found[own]})
    return other


def logged_value(value: Any) -> ParameterValue:
    """Return a value of a ParameterChange; older logs have it as Python's text.

    Raises LogFormatError.
    """
    try:
        found = literal_value(value) if isinstance(value, str) else from_value(value)
    except (ValueError, WrongTypeError) as error:
        raise LogFormatError(f"{value!r:.80} is no parameter value: {error}") from error
    if not isinstance(found, bool | int | float | str):
        raise LogFormatError(f"{value!r:.80} is no number, true, false or text")
    return found
