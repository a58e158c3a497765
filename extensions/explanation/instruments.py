"""Findings about the tracker and the IMU, which the vehicle itself compared in flight."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from console.evaluation.findings import Finding, Parameters, Spans, Topics, flagged
from extensions.explanation.blocks import overlaps

LASTED = 0.1
"""Limit in s of the time for which a flag was set."""
CLAIMS = {
    "tracker_contradicted": "The tracker's poses contradicted gyroscope or accelerometer: check "
    "that its frame is right-handed, and the axes of world and body",
    "inertial_suspect": "The IMU contradicted the tracker and the motors: an axis of the gyroscope "
    "was stuck, or the accelerometer is not calibrated, turned or shaken; the events say which",
    "tracker_tilted": "The verticals of tracker and accelerometer differed: the tracker's frame or "
    "the body's axes are tilted, or the accelerometer is not calibrated",
}
"""Claims, by the flag of the vehicle, with causes that look alike."""


def instruments(topics: Topics, _: Parameters, spans: Spans) -> Iterator[Finding]:
    """Find what the vehicle reported about its tracker and its IMU in flight."""
    for flag, claim in CLAIMS.items():
        set_ = [one for one in flagged(topics, flag) if overlaps(spans, *one)]
        lasted = sum(end - start for start, end in set_)
        if lasted < LASTED:
            continue
        yield Finding(
            kind=flag,
            weight=lasted / LASTED,
            start=set_[0][0],
            end=set_[-1][1],
            claim=f"{claim} ({lasted:.1f} s).",
            signals=(),
            label="reported",
            unit="0 or 1",
            limit=0.5,
            time=np.repeat(np.ravel(set_), 2),
            values=np.tile([0.0, 1.0, 1.0, 0.0], len(set_)),
        )
