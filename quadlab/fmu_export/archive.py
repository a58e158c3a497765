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

from quadlab.fmu_export.description import FOLDER, describe, layout
from quadlab.fmu_export.models import variables
from quadrotor.errors import StorageError
from vehicle.simulator.c_library import compile_library

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
