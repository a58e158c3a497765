"""The files of a campaign's rows: read while others write them, and joined at one moment."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from extensions.campaigns.beginning import ROWS
from quadrotor.errors import QuadlabError, StorageError

T = TypeVar("T")

AT_FDCWD, RENAME_EXCHANGE = -100, 2
"""Constants of renameat2(2)."""
UNSUPPORTED = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""Errors of a file system that cannot exchange two folders, as NFS."""
PAUSE, LONGEST = 0.01, 5.0
"""s between two looks for a folder that is just being renamed, and how long one looks."""


class RowFiles:
    """The files of a campaign's rows, in a folder of their own.

    A campaign that is over has one file. It takes the place of the others as a whole: the folder
    with it and the folder with them exchange their names.

    Args:
        campaign: the campaign's folder.
    """

    def __init__(self, campaign: Path) -> None:
        self.place = campaign / ROWS
        self.new, self._old = campaign / f"{ROWS}.new", campaign / f"{ROWS}.old"

    @property
    def paths(self) -> list[Path]:
        """Return the files at this moment, in the order of their names."""
        return sorted(self.place.glob("*.parquet"))

    def read(self, reading: Callable[[list[Path]], T]) -> T:
        """Call a function with the files, and return its result.

        It is called again if they were joined in the meantime: what it has then found may be of
        files that are gone, or of the same rows in two files.

        Raises StorageError for a file that is damaged.
        """
        import pyarrow as pa

        end = time.monotonic() + LONGEST
        while True:
            before = self._identity()
            try:
                found = reading(self.paths)
            except (OSError, QuadlabError, pa.ArrowInvalid) as error:
                if self._is_settled(before) or time.monotonic() > end:
                    if isinstance(error, pa.ArrowInvalid):
                        raise StorageError(
                            f"a file in {self.place} is damaged ({error}); remove it, then quadlab "
                            "campaign resume"
                        ) from None
                    raise
            else:
                if self._is_settled(before) or time.monotonic() > end:
                    return found
            time.sleep(PAUSE)

    def _identity(self) -> int | None:
        try:
            return self.place.stat().st_ino
        except FileNotFoundError:
            return None

    def _is_settled(self, before: int | None) -> bool:
        is_being_renamed = before is None and self._old.exists()
        return not is_being_renamed and self._identity() == before

    def replace(self) -> None:
        """Let the folder `new` take the place of the files. Raises OSError."""
        if exchange(self.new, self.place):
            shutil.rmtree(self.new)
            return
        self.place.rename(self._old)
        self.new.rename(self.place)
        shutil.rmtree(self._old)

    def mend(self) -> None:
        """Complete or remove the unfinished files of a killed run. Raises OSError."""
        if self._old.exists() and not self.place.exists():
            (self.new if self.new.exists() else self._old).rename(self.place)
        for one in (self.new, self._old):
            shutil.rmtree(one, ignore_errors=True)
        for part in self.place.glob("*.new"):
            part.unlink()


def exchange(one: Path, other: Path) -> bool:
    """Exchange the names of two folders at one moment; return False where that is not possible.

    Raises OSError.
    """
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    names = os.fsencode(one), os.fsencode(other)
    if rename(AT_FDCWD, names[0], AT_FDCWD, names[1], RENAME_EXCHANGE) == 0:
        return True
    if (code := ctypes.get_errno()) in UNSUPPORTED:
        return False
    raise OSError(code, os.strerror(code), str(one))
