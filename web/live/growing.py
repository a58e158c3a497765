"""Array that grows at its end and is cut at its front, in one piece."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

LEAST = 1024


class Growing:
    """Rows of one type, (N,) or (N, width)."""

    def __init__(self, dtype: npt.DTypeLike, width: int = 0) -> None:
        self._rows = np.empty((LEAST, width) if width else LEAST, dtype)
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    @property
    def rows(self) -> npt.NDArray[Any]:
        """Return the rows, which stay as they are until the next call of another method."""
        return self._rows[self._begin : self._end]

    def extend(self, rows: npt.ArrayLike) -> None:
        """Add rows at the end."""
        new = np.asarray(rows)
        needed = len(self) + len(new)
        if self._end + len(new) > len(self._rows):
            kept, size = self.rows, len(self._rows)
            if 5 * needed > 4 * size:
                size = 3 * needed // 2
                self._rows = np.empty((size, *self._rows.shape[1:]), self._rows.dtype)
            self._rows[: len(kept)] = kept
            self._begin, self._end = 0, len(kept)
        self._rows[self._end : self._end + len(new)] = new
        self._end += len(new)

    def drop(self, count: int) -> None:
        """Remove rows at the front."""
        self._begin += min(count, len(self))
