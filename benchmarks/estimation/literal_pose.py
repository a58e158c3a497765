"""The pose from bearings exactly as printed in Sec. 6.2, for comparison with `planar_pose`.

X2 = H X1, H = R + r n^T / d (after eq. 13); H from the bearing pairs by the four-point algorithm of
the paper's reference [8] (Y. Ma et al., "An Invitation to 3-D Vision", algorithm 5.2: scale by the
second singular value, sign by x2 . H x1 > 0, both of which the paper omits); then R = (m m' m'') (n
n' n'')^T with m' = H n', m'' = H n'', m = m' x m'', and t = d (H - R), to be read as d (H - R) n,
because H - R is a matrix. R is not made a rotation, and the choice of n' and n'' is arbitrary.

What the paper calls the body's pose, (W_R_B, r_B), is the inverse: it maps world to body. It is
inverted here as if it were a rotation, (R^T, -R^T t), so that its error can be measured.
"""

from __future__ import annotations

import numpy as np

from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array


def literal_pose(
    beacons_w: Array, bearings_b: Array, normal_w: Array, d: float
) -> tuple[Array, Array]:
    """Return position_w (3,) m, and R_wb (3, 3), which is a rotation only without noise.

    Args:
        beacons_w: (N, 3) m, N >= 4, on the plane normal_w . X = d.
        bearings_b: (N, 3) unit.
        normal_w: (3,) unit, world axes.
        d: m, of the plane from the world's origin.

    Raises DegenerateGeometryError when d = 0 or the bearings do not determine H.
    """
    if d == 0.0:
        raise DegenerateGeometryError(
            "the beacons' plane goes through the world's origin, d = 0, by which eq. 33 divides; "
            "use planar_pose"
        )
    x1 = beacons_w / np.sqrt((beacons_w**2).sum(axis=1))[:, None]
    # x2 cross (H x1) = 0, linear in the rows of H.
    x, y, z = bearings_b.T[:, :, None]
    zero = np.zeros_like(x1)
    system = np.concatenate(
        [
            np.hstack([zero, -z * x1, y * x1]),
            np.hstack([z * x1, zero, -x * x1]),
            np.hstack([-y * x1, x * x1, zero]),
        ]
    )
    _, singular, vt = np.linalg.svd(system)
    if singular[7] < 1e-9 * singular[0]:
        raise DegenerateGeometryError(
            "bearings do not determine the homography: use planar_pose with a prediction"
        )
    H = vt[8].reshape(3, 3)
    H /= np.linalg.svd(H, compute_uv=False)[1]
    if ((x1 @ H.T) * bearings_b).sum() < 0.0:
        H = -H
    n = np.asarray(normal_w, dtype=float)
    n1 = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
    n1 /= np.linalg.norm(n1)
    n2 = np.cross(n, n1)
    m1, m2 = H @ n1, H @ n2
    R = np.column_stack([np.cross(m1, m2), m1, m2]) @ np.column_stack([n, n1, n2]).T
    t = d * (H - R) @ n
    position: Array = -R.T @ t
    return position, R.T
