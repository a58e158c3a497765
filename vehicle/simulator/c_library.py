"""C sources compiled into a library for this computer."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from quadrotor.errors import StorageError


def compile_library(sources: Sequence[Path], out: Path, flags: Sequence[str] = ()) -> None:
    """Compile C files of one folder into the shared library `out`.

    Raises StorageError when there is no compiler, with what to install, and for its first
    complaint.
    """
    names = [source.name for source in sources]
    if shutil.which("gcc") is None:
        raise StorageError(
            f"there is no gcc to compile {' and '.join(names)}; on Debian: apt install gcc"
        )
    # By their names alone, so that the library does not depend on the folder.
    words = ["gcc", "-O2", "-shared", "-fPIC", *flags, "-o", str(out.absolute()), *names, "-lm"]
    ran = subprocess.run(words, cwd=sources[0].parent, capture_output=True, text=True, check=False)
    if ran.returncode:
        said = (ran.stderr.strip() or "gcc failed").splitlines()
        first = next((line for line in said if "error" in line), said[0])
        raise StorageError(f"{names[-1]} cannot be compiled: {first}")
