"""A common clock for all topics of a log, and the gaps of a topic."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Stamps = npt.NDArray[np.int64]

OTHER_CLOCK = 500_000_000
"""Median delay, in ns, above which a source's clock counts as different from the recorder's."""
STEPPED = 5_000_000_000
"""Variation of the delay, in ns, above which the source's stamps are not used."""
GAP_PERIODS = 4.0
SHORTEST_GAP = 0.05  # s
MAX_GAPS = 20_000
PIECE = 100_000
"""Number of stamps that are converted at once."""


def common_stamps(log_ns: Stamps, publish_ns: Stamps) -> Stamps:
    """Return when each message was valid, ns of the recorder's clock, shape (N,).

    The source's stamps are more precise (five samples arrive in one packet). The clock of a vehicle
    that differs from the recorder's is converted by the shortest delay seen.
    """
    delay = log_ns - publish_ns
    shortest = delay.min()
    if not publish_ns.any() or int(delay.max() - shortest) > STEPPED:
        return log_ns
    if abs(float(np.median(delay, overwrite_input=True))) < OTHER_CLOCK:
        return publish_ns
    del delay  # in a long log as large as the stamps
    moved: Stamps = publish_ns + shortest
    return moved


def gaps(times: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return the indices after which a topic was silent for unusually long, shape (G,)."""
    if len(times) < 3:
        return np.zeros(0, np.int64)
    usual = float(np.median(np.diff(times), overwrite_input=True))
    limit = max(GAP_PERIODS * usual, SHORTEST_GAP)
    return np.flatnonzero(np.diff(times) > limit)[:MAX_GAPS]


def seconds_since(stamps_ns: Stamps, start_ns: int) -> npt.NDArray[np.float64]:
    """Return the seconds (N,); piece by piece, so that a long log's stamps are held only twice."""
    out = np.empty(len(stamps_ns))
    for begin in range(0, len(out), PIECE):
        piece = slice(begin, begin + PIECE)
        out[piece] = (stamps_ns[piece] - start_ns).astype(np.float64) / 1e9
    return out
