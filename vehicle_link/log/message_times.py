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


def common_stamps(log_ns: Stamps, publish_ns: Stamps) -> Stamps:
    """When each message was true, ns of the recorder's clock, shape (N,).

    The source's stamps are the finer ones (five samples come in one packet). A vehicle with a
    clock of its own is brought onto the recorder's by the shortest delay seen.
    """
    delay = log_ns - publish_ns
    if not publish_ns.any() or int(delay.max() - delay.min()) > STEPPED:
        return log_ns
    if abs(float(np.median(delay))) < OTHER_CLOCK:
        return publish_ns
    moved: Stamps = publish_ns + delay.min()
    return moved


def gaps(times: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Indices behind which a topic was silent for longer than it usually is, shape (G,)."""
    if len(times) < 3:
        return np.zeros(0, np.int64)
    steps = np.diff(times)
    limit = max(GAP_PERIODS * float(np.median(steps)), SHORTEST_GAP)
    return np.flatnonzero(steps > limit)[:MOST_GAPS]
