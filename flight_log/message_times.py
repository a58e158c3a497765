"""One clock for all topics of a log, and where a topic is silent."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Stamps = npt.NDArray[np.int64]

OTHER_CLOCK = 500_000_000
"""ns of median delay above which a source's clock is taken for another than the recorder's."""
STEPPED = 5_000_000_000
"""ns of variation of the delay above which the source's stamps are not believed at all."""
GAP_PERIODS = 4.0
SHORTEST_GAP = 0.05  # s
MOST_GAPS = 20_000
PIECE = 100_000
"""Stamps at once."""


def common_stamps(log_ns: Stamps, publish_ns: Stamps) -> Stamps:
    """Return when each message was true, ns of the recorder's clock, shape (N,).

    The source's stamps are the finer ones (five samples come in one packet). A vehicle with a
    clock of its own is brought onto the recorder's by the shortest delay seen.
    """
    delay = log_ns - publish_ns
    shortest = delay.min()
    if not publish_ns.any() or int(delay.max() - shortest) > STEPPED:
        return log_ns
    if abs(float(np.median(delay, overwrite_input=True))) < OTHER_CLOCK:
        return publish_ns
    del delay  # of a long log as large as the stamps
    moved: Stamps = publish_ns + shortest
    return moved


def gaps(times: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return indices behind which a topic was silent for longer than it usually is, shape (G,)."""
    if len(times) < 3:
        return np.zeros(0, np.int64)
    usual = float(np.median(np.diff(times), overwrite_input=True))
    limit = max(GAP_PERIODS * usual, SHORTEST_GAP)
    return np.flatnonzero(np.diff(times) > limit)[:MOST_GAPS]


def seconds_since(stamps_ns: Stamps, start_ns: int) -> npt.NDArray[np.float64]:
    """Return the seconds (N,); piece by piece, so a long log's stamps are held twice only."""
    out = np.empty(len(stamps_ns))
    for begin in range(0, len(out), PIECE):
        piece = slice(begin, begin + PIECE)
        out[piece] = (stamps_ns[piece] - start_ns).astype(np.float64) / 1e9
    return out
