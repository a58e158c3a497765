"""The FMU of a model: modelDescription.xml of FMI 2.0, the header that tells the C sources the same
things, and the archive of both.
"""

from __future__ import annotations

import hashlib
import io
import math
import platform
import uuid
import zipfile
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

from quadlab.fmu_export.models import Variable, variables
from quadrotor.errors import StorageError
from vehicle.simulator.c_library import compile_library

FOLDER = Path(__file__).with_name("c")
PLAIN = str.maketrans({"°": "deg", "√": "sqrt", " ": ".", "²": "2", "³": "3", "⁴": "4"})
BASE = {
    "N": {"kg": 1, "m": 1, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "h": {"s": 1},
    "°": {"rad": 1},
    "deg": {"rad": 1},
    "1": {},
} | {name: {name: 1} for name in ("kg", "m", "s", "A", "rad")}
"""Exponents of the base units."""
FACTORS = {"h": 3600.0, "°": math.pi / 180.0, "deg": math.pi / 180.0}


def describe(model: str, shown: Sequence[Variable], guid: str) -> str:
    """Return modelDescription.xml."""
    outputs = [n for n, one in enumerate(shown, 1) if one.causality == "output"]
    return Template((FOLDER / "modelDescription.xml").read_text()).substitute(
        model=model,
        guid=guid,
        version=version("quadlab"),
        units="\n".join(map(_unit, sorted({one.unit for one in shown} - {""}))),
        variables="\n".join(_variable(n, one) for n, one in enumerate(shown)),
        outputs="\n".join(_tag("Unknown", index=n) for n in outputs),
    )


def layout(shown: Sequence[Variable], guid: str) -> str:
    """Return layout.h."""
    kinds = ["integer" if one.integer else one.causality for one in shown]
    names = [one.name.removesuffix("[1]").replace(".", "_").upper() for one in shown]
    return Template((FOLDER / "layout.h").read_text()).substitute(
        guid=guid,
        start=", ".join(repr(float(one.start or 0)) for one in shown),
        places="\n".join(f"    {name} = {n}," for n, name in enumerate(names) if "[" not in name),
        tunable=sum(one.variability == "fixed" for one in shown),
        output=kinds.index("output"),
        integer=kinds.index("integer"),
        count=len(shown),
    )


def _tag(name: str, content: str = "", /, **attributes: object) -> str:
    """Return an element of XML, without the attributes that say nothing."""
    told = {key: str(value) for key, value in attributes.items() if value not in (None, "")}
    words = " ".join([name, *(f"{key}={quoteattr(value)}" for key, value in told.items())])
    return f"<{words}>{content}</{name}>" if content else f"<{words}/>"


def _variable(number: int, one: Variable) -> str:
    convert = int if one.integer else float
    limits = {"min": one.minimum, "max": one.maximum, "start": one.start}
    told = {key: convert(value) for key, value in limits.items() if value is not None}
    return _tag(
        "ScalarVariable",
        _tag("Integer" if one.integer else "Real", unit=unit_name(one.unit), **told),
        name=one.name,
        valueReference=number,
        causality=one.causality,
        variability=one.variability,
        initial={"output": "calculated", "parameter": "exact"}.get(one.causality),
        description=one.description,
    )


def _unit(unit: str) -> str:
    base = base_unit(unit)
    return _tag("Unit", _tag("BaseUnit", **base) if base else "", name=unit_name(unit))


def unit_name(unit: str) -> str:
    """Return a unit as FMI's tools write it: `N s/m` is N.s/m, `1/s²` is 1/s2."""
    return unit.translate(PLAIN)


def base_unit(unit: str) -> dict[str, float] | None:
    """Return exponents of the base units and the factor; None for one that has no SI units."""
    exponents: Counter[str] = Counter()
    factor = 1.0
    for part, sign in zip(unit.split("/"), (1, -1), strict=False):
        for word in part.split():
            symbol = word.rstrip("²³⁴")
            if symbol not in BASE:
                return None
            factor *= FACTORS.get(symbol, 1.0)
            for name, exponent in BASE[symbol].items():
                exponents[name] += sign * exponent * int(word[len(symbol) :].translate(PLAIN) or 1)
    return {**exponents} if factor == 1.0 else {**exponents, "factor": factor}


FLAGS = "-std=c11 -Wall -Wextra -Wconversion -Werror -ffp-contract=off -fvisibility=hidden"


def export_fmu(model: str, words: Sequence[str], path: Path) -> None:
    """Write the FMU of `plant` or `law` for this computer; equal words write equal bytes.

    Args:
        words: `NAME=VALUE`, start values other than the defaults.

    Raises UsageError for words that are wrong, StorageError without a compiler or a place.
    """
    shown, name = variables(model, words), f"quadlab_{model}"
    compiled = ("fmi2.c", f"{model}.c")
    sources = {n: (FOLDER / n).read_text() for n in (*compiled, "fmi2.h", "model.h", "vectors.h")}
    content = "".join([describe(model, shown, ""), *sources.values()])
    guid = f"{{{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}"
    sources["layout.h"] = layout(shown, guid)
    files = {"modelDescription.xml": describe(model, shown, guid).encode()}
    with TemporaryDirectory(prefix="quadlab-fmu-") as made:
        library = Path(made, f"{name}.so")
        for file, text in sources.items():
            Path(made, file).write_text(text)
            files[f"sources/{file}"] = text.encode()
        compile_library([Path(made, file) for file in compiled], library, FLAGS.split())
        files[f"binaries/linux{platform.architecture()[0][:2]}/{name}.so"] = library.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file, data in files.items():
            info = zipfile.ZipInfo(file)  # of 1980, whenever it is written
            info.external_attr = 0o644 << 16
            archive.writestr(info, data, zipfile.ZIP_DEFLATED)
    try:
        path.write_bytes(packed.getvalue())
    except OSError as error:
        raise StorageError(f"--out {path} cannot be written: {error.strerror}") from None
