"""Bytes that wait on the disk instead of in memory, for what is written at the end of a file."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from quadrotor.errors import StorageError

PIECE = 1 << 16
"""Bytes."""


class Aside:
    """A file without a name in `folder`: gone with its process, however that ends.

    Made with the first `put`. One thread at a time.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: IO[bytes] | None = None

    def put(self, data: bytes) -> None:
        """Behind what was put before. Raises StorageError."""
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile(dir=self._folder, buffering=0)  # noqa: SIM115
            left = memoryview(data)
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise StorageError(
                f"cannot put an index aside in {self._folder}: {error.strerror or error}; "
                "what was written before stays readable"
            ) from error

    def __iter__(self) -> Iterator[bytes]:
        """All that was put, in pieces of PIECE; more may be put after it. Raises StorageError."""
        if self._file is None:
            return
        try:
            self._file.seek(0)
            while piece := self._file.read(PIECE):
                yield piece
        except OSError as error:
            raise StorageError(
                f"cannot read what was put aside in {self._folder}: {error.strerror or error}"
            ) from error

    def close(self) -> None:
        """Nothing can be put after it."""
        if self._file is not None:
            self._file.close()
