"""The kind and the tunable parameters of an FMU, by its description; see
`vehicle.plugins.declared`."""

from __future__ import annotations

import keyword
import re
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from quadrotor.errors import UsageError
from quadrotor.parameters import Parameters, ParameterStore, parameter, parameters_of

DESCRIPTION, LARGEST = "modelDescription.xml", 1 << 24
"""File in the archive, and its largest size in bytes."""
UNREADABLE = (
    *(OSError, EOFError, LookupError, ValueError, OverflowError),
    *(RuntimeError, zlib.error, zipfile.BadZipFile, ElementTree.ParseError),
)
"""Errors of reading a damaged or encrypted archive."""
UNPACKED, ENTRIES = 1 << 28, 10_000
"""Most bytes and files that an FMU may be unpacked to."""
MOST = 100
"""Parameters that are shown of one FMU."""
TYPES = {
    **dict.fromkeys(("Real", "Float64"), float),
    **dict.fromkeys(("Integer", "Int32"), int),
    "Boolean": bool,
}


class Tunable(NamedTuple):
    """A variable of an FMU that may be set between two steps.

    Attributes:
        kind: "Real", "Integer", "Boolean" (FMI 2), "Float64", "Int32" or "Boolean" (FMI 3).
    """

    reference: int
    kind: str


def declared_by(path: Path) -> tuple[Parameters | None, dict[str, Tunable]]:
    """Return the tunable parameters of an FMU as parameters, None when it has none, and the
    variables by the parameters' names: those of the FMU with `_` for what is no letter or digit.

    Raises UsageError for what is no FMU.
    """
    fields: dict[str, Any] = {}
    places: dict[str, Tunable] = {}
    try:
        for name, reference, kind, told in _tunables(_description(path)):
            if len(places) == MOST:
                break
            field = _field_name(name, places)
            start, limits = _start_and_limits(kind, told)
            text = told.get("description", name)
            made = parameter(start, description=text, unit=told.get("unit", ""), **limits)
            fields[field] = (TYPES[kind], made)
            places[field] = Tunable(reference, kind)
        own = parameters_of(Parameters, "FmuParameters", fields)() if fields else None
        if own is not None:
            ParameterStore(own)
    except UNREADABLE as error:
        raise UsageError(f"{path.name}: its parameters cannot be read ({error})") from None
    return own, places


def check_size(path: Path) -> None:
    """Check the size of an unpacked FMU by its stated sizes, beyond which zipfile writes nothing.

    Raises UsageError.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
    except UNREADABLE as error:
        raise UsageError(f"{path.name} is not an FMU that fmpy can read: {error}") from None
    size = sum(one.file_size for one in entries)
    if size > UNPACKED or len(entries) > ENTRIES:
        raise UsageError(
            f"{path.name} is {size / 1e6:.0f} MB in {len(entries)} files unpacked; allowed are "
            f"{UNPACKED / 1e6:.0f} MB in {ENTRIES}: leave out sources and other resources"
        )


def kind_of(path: Path) -> str:
    """Return "estimator" for an FMU that answers an attitude and no thrust, else "law"."""
    try:
        variables = _description(path).iterfind("ModelVariables/*[@causality='output']")
        stems = {one.get("name", "").partition("[")[0] for one in variables}
    except (UsageError, *UNREADABLE):  # told when it is chosen
        return "law"
    return "estimator" if "quaternion_wb" in stems and "thrust" not in stems else "law"


def _description(path: Path) -> ElementTree.Element:
    """Return the root of an FMU's description. Raises UsageError, and errors of UNREADABLE."""
    with zipfile.ZipFile(path) as archive:
        if archive.getinfo(DESCRIPTION).file_size > LARGEST:
            raise UsageError(f"{path.name}: its {DESCRIPTION} is larger than {LARGEST} bytes")
        return ElementTree.fromstring(archive.read(DESCRIPTION))


def _tunables(root: ElementTree.Element) -> Iterator[tuple[str, int, str, dict[str, str]]]:
    """Yield name, value reference, kind and attributes of each scalar parameter that is tunable."""
    types: dict[str, dict[str, str]] = {}
    for one in root.iterfind("TypeDefinitions/*"):
        types[one.get("name", "")] = one.attrib | (one[0].attrib if len(one) else {})
    for variable in root.iterfind("ModelVariables/*"):
        if (variable.get("causality"), variable.get("variability")) != ("parameter", "tunable"):
            continue
        typed = variable[0] if variable.tag == "ScalarVariable" else variable  # FMI 2, FMI 3
        if typed.tag not in TYPES or variable.find("Dimension") is not None:
            continue
        declared = types.get(typed.get("declaredType", ""), {})
        kept = {key: declared[key] for key in ("unit", "min", "max") if key in declared}
        told = kept | typed.attrib | variable.attrib
        yield told["name"], int(told["valueReference"]), typed.tag, told


def _start_and_limits(kind: str, told: dict[str, str]) -> tuple[Any, dict[str, Any]]:
    text = told.get("start", "0")
    if TYPES[kind] is bool:
        return text in ("true", "1"), {}
    limits = {key: told.get(name) for key, name in (("ge", "min"), ("le", "max"))}
    return TYPES[kind](text), {key: float(n) for key, n in limits.items() if n is not None}


def _field_name(name: str, taken: dict[str, Tunable]) -> str:
    field = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "p"
    if not field.isidentifier():
        field = f"p_{field}"
    if keyword.iskeyword(field) or hasattr(Parameters, field):
        field += "_"
    several = sum(re.fullmatch(rf"{field}(_\d+)?", one) is not None for one in taken)
    return f"{field}_{several + 1}" if field in taken else field
