"""Whole motor references whose mean is the wanted one.

A count of one motor is 0.7 rad/s² of roll. Rounding each tick for itself lets the vehicle wander
in a limit cycle of some millimetres; here what rounding takes away is given back at the next
tick (first-order noise shaping), far above what the motors' lag lets through.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

REFERENCE_MAX = 255


class ReferenceRounding:
    """One vehicle's carried fractions, each within half a count."""

    def __init__(self) -> None:
        self._carry = [0.0, 0.0, 0.0, 0.0]

    def round(self, wanted: npt.NDArray[np.float64]) -> tuple[int, int, int, int]:
        """Counts 0..255 for `wanted` (4,), which is overwritten with them."""
        carry = self._carry
        counts = []
        for i, reference in enumerate(wanted.tolist()):
            exact = reference + carry[i]
            count = round(exact)
            if not 0 <= count <= REFERENCE_MAX:
                count = 0 if count < 0 else REFERENCE_MAX
                exact = count
            carry[i] = exact - count
            counts.append(count)
        wanted[:] = counts
        return counts[0], counts[1], counts[2], counts[3]
