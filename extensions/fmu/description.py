"""The FMU of a model: modelDescription.xml of FMI 2.0 or 3.0, the header that tells the C sources
the same things, and the archive of both.
"""

from __future__ import annotations

import hashlib
import io
import math
import platform
import uuid
import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

from extensions.fmu.models import Variable, variables
from quadrotor.errors import os_errors
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
TIME = {"causality": "independent", "variability": "continuous"}
FACTORS = {"h": 3600.0, "°": math.pi / 180.0, "deg": math.pi / 180.0}


def describe(model: str, shown: Sequence[Variable], guid: str, fmi: int) -> str:
    """Return modelDescription.xml."""
    if fmi == 2:
        variables = [_variable(n, one) for n, one in enumerate(shown)]
        places = [n for n, one in enumerate(shown, 1) if one.causality == "output"]
        outputs = [_tag("Unknown", index=n) for n in places]
    else:
        grouped = list(_arrays(shown))
        variables = [_variable3(n, numbers) for n, numbers in grouped]
        variables.append(_tag("Float64", name="time", valueReference=len(shown), **TIME))
        places = [n for n, (one, *_) in grouped if one.causality == "output"]
        outputs = [
            _tag(kind, valueReference=n) for kind in ("Output", "InitialUnknown") for n in places
        ]
    return Template((FOLDER / f"modelDescription{fmi}.xml").read_text()).substitute(
        model=model,
        guid=guid,
        version=version("quadlab"),
        units="\n".join(map(_unit, sorted({one.unit for one in shown} - {""}))),
        variables="\n".join(variables),
        outputs="\n".join(outputs),
    )


def layout(shown: Sequence[Variable], guid: str) -> str:
    """Return layout.h."""
    kinds = ["integer" if one.integer else one.causality for one in shown]
    names = [one.name.removesuffix("[1]").replace(".", "_").upper() for one in shown]
    sizes = [0] * len(shown)
    for n, numbers in _arrays(shown):
        sizes[n] = len(numbers)
    return Template((FOLDER / "layout.h").read_text()).substitute(
        guid=guid,
        sizes=", ".join(map(str, sizes)),
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


def _arrays(shown: Sequence[Variable]) -> Iterator[tuple[int, list[Variable]]]:
    """Yield the numbers of each variable of FMI 3, with the place of the first."""
    stems = [one.name.partition("[")[0] for one in shown]
    for n, stem in enumerate(stems):
        if n == 0 or stem != stems[n - 1]:
            yield n, [shown[k] for k in range(n, n + stems.count(stem))]


def _variable3(number: int, numbers: Sequence[Variable]) -> str:
    one, size = numbers[0], len(numbers)
    convert = int if one.integer else float
    limits = {"min": one.minimum, "max": one.maximum}
    told = {key: convert(value) for key, value in limits.items() if value is not None}
    return _tag(
        "Int32" if one.integer else "Float64",
        _tag("Dimension", start=size) if size > 1 else "",
        name=one.name.partition("[")[0],
        valueReference=number,
        causality=one.causality,
        variability=one.variability,
        initial={"output": "calculated", "parameter": "exact"}.get(one.causality),
        start=" ".join(str(convert(v.start)) for v in numbers if v.start is not None),
        unit="" if one.integer else unit_name(one.unit),
        description=one.description,
        **told,
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


def export_fmu(model: str, words: Sequence[str], path: Path, fmi: int = 2) -> None:
    """Write the FMU of `plant` or `law` for this computer; equal words write equal bytes.

    Args:
        words: `NAME=VALUE`, start values other than the defaults.
        fmi: 2 or 3.

    Raises UsageError for words that are wrong, StorageError without a compiler or a place.
    """
    write_fmu(FOLDER / f"{model}.c", variables(model, words), path, fmi)


def write_fmu(source: Path, shown: Sequence[Variable], path: Path, fmi: int) -> None:
    """Write the FMU of a model in C: `source` has its two functions of model.h.

    Args:
        shown: its variables: fixed parameters, tunable ones, inputs, outputs, in this order, and
            behind them at least one integer.

    Raises StorageError without a compiler or a place.
    """
    model, name = source.stem, f"quadlab_{source.stem}"
    compiled, header = (f"fmi{fmi}.c", source.name), f"fmi{fmi}.h"
    places = (FOLDER / compiled[0], source, *(FOLDER / n for n in (header, "model.h", "vectors.h")))
    sources = {place.name: place.read_text() for place in places}
    content = "".join([describe(model, shown, "", fmi), *sources.values()])
    guid = f"{{{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}"
    sources["layout.h"] = layout(shown, guid)
    files = {"modelDescription.xml": describe(model, shown, guid, fmi).encode()}
    place = f"linux{platform.architecture()[0][:2]}"
    if fmi == 3:
        build = Template((FOLDER / "buildDescription.xml").read_text()).substitute(model=model)
        files["sources/buildDescription.xml"] = build.encode()
        place = f"{platform.machine().replace('arm64', 'aarch64')}-linux"
    with TemporaryDirectory(prefix="quadlab-fmu-") as made:
        library = Path(made, f"{name}.so")
        for file, text in sources.items():
            Path(made, file).write_text(text)
            files[f"sources/{file}"] = text.encode()
        compile_library([Path(made, file) for file in compiled], library, FLAGS.split())
        files[f"binaries/{place}/{name}.so"] = library.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file, data in files.items():
            info = zipfile.ZipInfo(file)  # of 1980, whenever it is written
            info.external_attr = 0o644 << 16
            archive.writestr(info, data, zipfile.ZIP_DEFLATED)
    with os_errors(lambda why: f"--out {path} cannot be written: {why}"):
        path.write_bytes(packed.getvalue())
