"""modelDescription.xml of FMI 2.0, and the header that tells the C sources the same."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.metadata import version
from xml.etree import ElementTree as Xml

from quadlab.fmu_export.models import Variable

BASE: dict[str, dict[str, float]] = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "h": {"s": 1, "factor": 3600.0},
    "°": {"rad": 1, "factor": math.pi / 180.0},
    "deg": {"rad": 1, "factor": math.pi / 180.0},
    "1": {},
}
"""Exponents of the base units, and the factor to them."""
POWERS = {"²": 2, "³": 3, "⁴": 4}


def describe(model: str, shown: Sequence[Variable], guid: str, sources: Sequence[str]) -> str:
    """Return modelDescription.xml.

    Args:
        model: its name, which the binary has too. sources: names of the C files.
    """
    root = Xml.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model,
        guid=guid,
        description=f"quadlab: {model.removeprefix('quadlab_')} of a quadrotor",
        generationTool=f"quadlab {version('quadlab')}",
        variableNamingConvention="structured",
    )
    simulation = Xml.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=model,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
    )
    files = Xml.SubElement(simulation, "SourceFiles")
    for name in sources:
        Xml.SubElement(files, "File", name=name)
    units = Xml.SubElement(root, "UnitDefinitions")
    for unit in sorted({one.unit for one in shown if one.unit}):
        named = Xml.SubElement(units, "Unit", name=unit_name(unit))
        if base := base_unit(unit):
            Xml.SubElement(named, "BaseUnit", {n: f"{v:.17g}" for n, v in base.items()})
    texts = [one for one in shown if one.choices]
    if texts:
        types = Xml.SubElement(root, "TypeDefinitions")
        for one in texts:
            kind = Xml.SubElement(types, "SimpleType", name=f"{one.name}_choices")
            items = Xml.SubElement(kind, "Enumeration")
            for number, choice in enumerate(one.choices, 1):
                Xml.SubElement(items, "Item", name=choice, value=str(number))
    log = Xml.SubElement(root, "LogCategories")
    Xml.SubElement(log, "Category", name="logStatusError")
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime="10", stepSize="0.002")
    variables = Xml.SubElement(root, "ModelVariables")
    for number, one in enumerate(shown):
        _add(variables, number, one)
    structure = Xml.SubElement(root, "ModelStructure")
    outputs = [str(n) for n, one in enumerate(shown, 1) if one.causality == "output"]
    for part in ("Outputs", "InitialUnknowns"):
        unknowns = Xml.SubElement(structure, part)
        for index in outputs:
            Xml.SubElement(unknowns, "Unknown", index=index)
    Xml.indent(root, " ")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{Xml.tostring(root, "unicode")}\n'


def _add(variables: Xml.Element, number: int, one: Variable) -> None:
    scalar = Xml.SubElement(
        variables,
        "ScalarVariable",
        name=one.name,
        valueReference=str(number),
        causality=one.causality,
        variability=one.variability,
    )
    if one.description:
        scalar.set("description", one.description)
    if one.causality != "input":
        scalar.set("initial", "calculated" if one.causality == "output" else "exact")
    kind = "Enumeration" if one.choices else "Integer" if one.integer else "Real"
    value = Xml.SubElement(scalar, kind)
    if one.choices:
        value.set("declaredType", f"{one.name}_choices")
    if one.unit:
        value.set("unit", unit_name(one.unit))
    for key, number_ in (("min", one.minimum), ("max", one.maximum), ("start", one.start)):
        if number_ is not None:
            value.set(key, str(int(number_)) if one.integer else repr(float(number_)))


def unit_name(unit: str) -> str:
    """Return a unit as FMI's tools write it: `N s/m` is N.s/m, `1/s²` is 1/s2."""
    name = unit.replace("°", "deg").replace("√", "sqrt").replace(" ", ".")
    for sign, power in POWERS.items():
        name = name.replace(sign, str(power))
    return name


def base_unit(unit: str) -> dict[str, float] | None:
    """Return exponents of the base units and the factor; None for one that has no SI units."""
    out: dict[str, float] = {}
    factor = 1.0
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for word in part.split():
            power = sign * POWERS.get(word[-1], 1)
            base = BASE.get(word.rstrip("".join(POWERS)))
            if base is None:
                return None
            for name, exponent in base.items():
                if name == "factor":
                    factor *= exponent**power
                else:
                    out[name] = out.get(name, 0) + power * exponent
    return out if factor == 1.0 else out | {"factor": factor}


def header(shown: Sequence[Variable], guid: str) -> str:
    """Return layout.h: where each variable is in the model's array, and the start values.

    A vector has the name of its first number.
    """
    kinds = [one.causality if not one.integer else "integer" for one in shown]
    first_output = kinds.index("output")
    first_integer = kinds.index("integer")
    first_tunable = sum(one.variability == "fixed" for one in shown)
    places = [
        f"    {one.name.removesuffix('[1]').replace('.', '_').upper()} = {number},\n"
        for number, one in enumerate(shown)
        if "[" not in one.name or one.name.endswith("[1]")
    ]
    starts = ", ".join(repr(one.start or 0.0) for one in shown)
    return (
        "/* Written by `quadlab export fmu`: where each variable is, and where it starts. */\n"
        f'#ifndef LAYOUT_H\n#define LAYOUT_H\n\n#define GUID "{guid}"\n#define START {{{starts}}}\n'
        f"\nenum {{\n{''.join(places)}    FIRST_TUNABLE = {first_tunable},\n"
        f"    FIRST_OUTPUT = {first_output},\n    FIRST_INTEGER = {first_integer},\n"
        f"    COUNT = {len(shown)}\n}};\n\n#endif\n"
    )
