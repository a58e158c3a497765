"""A folder or tar file of certificates for another machine, with instructions for its user."""

from __future__ import annotations

import tarfile
import tempfile
from collections.abc import Callable
from pathlib import Path

from quadrotor.errors import StorageError
from vehicle_link.security.authority import TlsFiles

REMOTE_FOLDER = ".local/share/quadlab/certificates"
"""Default folder of the certificates on another machine, below its home folder."""


def write_bundle(out: Path, issue: Callable[[Path], TlsFiles]) -> Path:
    """Issue files for another machine; return where they are: a folder, or a file ending in .tar.

    Raises StorageError or LinkError.
    """
    out = out.expanduser().absolute()
    if out.suffix != ".tar":
        return issue(out).folder
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            files = issue(Path(folder))
            out.touch(mode=0o600)
            out.chmod(0o600)  # if the file existed already
            with tarfile.open(out, "w") as tar:
                for path in sorted(files.folder.iterdir()):
                    tar.add(path, path.name)
    except OSError as error:
        raise StorageError(f"cannot write {out}: {error.strerror or error}") from error
    return out


def how_to_copy(made: Path, host: str) -> list[str]:
    """Return lines with commands that copy the files to the machine `host` by ssh."""
    begin = f"ssh {host} 'mkdir -p -m 700 {REMOTE_FOLDER}"
    if made.suffix == ".tar":
        return [f"{begin} && tar -x -C {REMOTE_FOLDER}' < {made}"]
    return [f"{begin}'", f"scp -p {made}/* {host}:{REMOTE_FOLDER}/"]
