"""Parameter values as a TOML file with comments, and back.

The tables are the components, so that `[control.position]` with `kp_xy = 4.0` is
`control.position.kp_xy`. Comments are for people only.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from quadrotor.errors import MeasurementError
from quadrotor.json_object import JsonObject
from quadrotor.parameter_description import ParameterDescription, ParameterValue

LARGEST = 256 * 1024
"""Largest file, in bytes; all parameters are about 20 kB."""
_DEEP = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")
"""Pattern of a name with more than 32 parts.

No parameter has one, and the parser's time grows with the square of their number.
"""


def write_file(
    descriptions: Iterable[ParameterDescription],
    values: Mapping[str, ParameterValue],
    heading: str,
    *,
    modified_only: bool = False,
) -> str:
    """Write a TOML document, in which read-only parameters are comments."""
    lines, table = [f"# {line}" for line in heading.splitlines()], None
    for d in descriptions:
        if d.name not in values or (modified_only and values[d.name] == d.default):
            continue
        group, _, key = d.name.rpartition(".")
        if group != table:
            table = group
            lines += ["", f"[{group}]"]
        line = f"{key} = {_value(values[d.name])}  # {_comment(d)}"
        lines.append(f"# {line}" if d.read_only else line)
    return "\n".join(lines) + "\n"


def read_file(content: bytes) -> JsonObject:
    """Read values by name, unchecked. Raises MeasurementError with the place of a syntax error."""
    if len(content) > LARGEST:
        raise MeasurementError(f"the file is too large; allowed are {LARGEST} bytes")
    try:
        text = content.decode()
        if _DEEP.search(text):
            raise MeasurementError("this is not a parameter file: a name has 32 parts or more")
        read = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MeasurementError(
            f"this is not a TOML file of parameters ({error}); save one here as an example"
        ) from None
    return dict(_flat(read, ""))


def _flat(table: Mapping[str, Any], prefix: str) -> Iterable[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _value(value: ParameterValue) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _comment(d: ParameterDescription) -> str:
    parts = [d.unit] if d.unit else []
    if d.minimum is not None and d.maximum is not None:
        parts.append(f"{d.minimum:g} to {d.maximum:g}")
    if d.choices:
        parts.append(" or ".join(d.choices))
    default = f"{d.default:g}" if isinstance(d.default, float) else d.default
    parts.append(f"default {default}")
    if d.read_only:
        parts.append("at the start only, by --set")
    text = " ".join(f"{', '.join(parts)}: {d.description}".split())
    return "".join(c for c in text if c.isprintable())
