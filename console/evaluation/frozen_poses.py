"""Times at which a tracker repeated its last pose, or a part of it, with new stamps."""

from __future__ import annotations

import numpy as np

from console.evaluation.findings import Spans
from flight_log.fields import TRACKED, TRACKED_ATTITUDE
from flight_log.run import Series

BOTH, ONE = 0.1, 0.5
"""Times, in s, from which on repetition to the last bit is no chance: of the whole pose, and of
position or attitude alone, which a vehicle that hardly moves may repeat for a moment."""


def frozen_spans(poses: Series) -> Spans:
    """Return the intervals (s) from the last new pose to the next one."""
    still, unturned = (_repeats(poses, names) for names in (TRACKED, TRACKED_ATTITUDE))
    found = _lasting(poses, still & unturned, BOTH)
    found += _lasting(poses, still | unturned, ONE)
    merged: Spans = []
    for start, end in sorted(found):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def _repeats(poses: Series, names: tuple[str, ...]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which poses (N,) have the same values as the pose before, to the last bit."""
    rows = poses.rows(names)
    out = np.zeros(len(rows), bool)
    out[1:] = (rows[1:] == rows[:-1]).all(axis=1)
    return out


def _lasting(
    poses: Series, repeats: np.ndarray[tuple[int], np.dtype[np.bool_]], least: float
) -> Spans:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], repeats, [False]]).astype(int)))
    spans = [(float(poses.time[a - 1]), float(poses.time[b - 1])) for a, b in edges.reshape(-1, 2)]
    return [(start, end) for start, end in spans if end - start > least]
