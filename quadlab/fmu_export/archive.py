"""Compiles a model, and packs it with its description and sources into an FMU."""

from __future__ import annotations

import hashlib
import io
import platform
import uuid
import zipfile
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from quadlab.fmu_export.description import describe, header
from quadlab.fmu_export.models import variables
from quadrotor.errors import StorageError
from vehicle.simulator.c_library import compile_library

FOLDER = Path(__file__).with_name("c")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Werror")
FLAGS = ("-std=c11", *WARNINGS, "-ffp-contract=off", "-fvisibility=hidden")
FIRST_TIME = (1980, 1, 1, 0, 0, 0)
"""That a ZIP archive can tell: the same content is the same file."""


def export_fmu(model: str, words: Sequence[str], path: Path) -> None:
    """Write the FMU of `plant` or `law` for this computer.

    Args:
        words: `NAME=VALUE`, start values other than the defaults.

    Raises UsageError for words that are wrong, StorageError without a compiler or a place.
    """
    shown, name = variables(model, words), f"quadlab_{model}"
    compiled = ("fmi2.c", f"{model}.c")
    sources = {n: (FOLDER / n).read_text() for n in (*compiled, "fmi2.h", "model.h", "vectors.h")}
    content = describe(name, shown, "", compiled) + "".join(sources.values())
    guid = f"{{{uuid.UUID(bytes=hashlib.sha256(content.encode()).digest()[:16])}}}"
    sources["layout.h"] = header(shown, guid)
    files: dict[str, bytes] = {
        "modelDescription.xml": describe(name, shown, guid, compiled).encode()
    }
    with TemporaryDirectory(prefix="quadlab-fmu-") as made:
        folder = Path(made)
        for file, text in sources.items():
            (folder / file).write_text(text)
            files[f"sources/{file}"] = text.encode()
        library = folder / f"{name}.so"
        compile_library([folder / file for file in compiled], library, FLAGS)
        files[f"binaries/linux{platform.architecture()[0][:2]}/{name}.so"] = library.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in files.items():
            info = zipfile.ZipInfo(file, FIRST_TIME)
            info.external_attr = 0o644 << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, data)
    try:
        path.write_bytes(packed.getvalue())
    except OSError as error:
        raise StorageError(f"--out {path} cannot be written: {error.strerror}") from None
