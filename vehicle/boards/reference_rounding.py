"""Rounding of motor references to whole counts that keeps their mean."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled, direct

Array = npt.NDArray[np.float64]

REFERENCE_MAX = 255.0


@compiled
def _round(wanted: Array, carry: Array) -> tuple[int, int, int, int]:
    for i in range(4):
        exact = wanted[i] + carry[i]
        if not math.isfinite(exact):
            raise ValueError("a motor reference is not finite")
        whole = np.rint(exact)
        wanted[i] = int(min(max(whole, 0.0), REFERENCE_MAX))
        # The rounding error of a saturated reference is not carried over.
        carry[i] = exact - whole if wanted[i] == whole else 0.0
    return int(wanted[0]), int(wanted[1]), int(wanted[2]), int(wanted[3])


class ReferenceRounding:
    """Motor rounding of one vehicle, with carried errors within half a count."""

    def __init__(self) -> None:
        self._carry = np.zeros(4)
        self._round = direct(_round, self._carry, self._carry)

    def round(self, wanted: Array) -> tuple[int, int, int, int]:
        """Return counts 0..255 for `wanted` (4,), which is overwritten with them.

        Raises ValueError when one is not finite.
        """
        return self._round(wanted, self._carry)
