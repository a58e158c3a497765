"""The array, (13 + N, 6), in which a frame of N bearings is solved.

It is one array instead of ten, because passing an array takes as long as half a Gauss-Newton step.

| rows | columns 0 to 2 | columns 3 to 5 |
|---|---|---|
| 0 to 5 | covariance, all six columns | |
| `POSITION` | position_w, m: of the prediction, then the pose's | residual, rad |
| `ATTITUDE` | quaternion_wb in columns 0 to 3 | columns 4, 5: step limit; 1 with a prediction |
| `CENTER` | the plane's centre, m, world axes | three of the four beacons of the homography |
| `PLANE`, 3 rows | M of the homography | e1, e2, e3, world axes |
| `PLANE` + 3 | 1/c1, 1/c2, 1/c3 | extent, m; the fourth beacon; 1 when the four span the plane |
| `SIGHTS`, N rows | beacon from the centre, m, world axes | its unit bearing, body axes |
"""

from __future__ import annotations

from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import Vector

POSITION, ATTITUDE, CENTER, PLANE, SIGHTS = 6, 7, 8, 9, 13


@compiled(inner=True)
def right(row: Array) -> Vector:
    """Return columns 3 to 5 of a row."""
    return row[3], row[4], row[5]


@compiled(inner=True)
def store_right(v: Vector, row: Array) -> None:
    """Store v in columns 3 to 5 of a row."""
    row[3], row[4], row[5] = v
