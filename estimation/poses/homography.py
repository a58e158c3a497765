"""Pose from four bearings to coplanar beacons by their homography, in closed form (Sec. 6.2).

With a = (alpha, beta, 1) the plane coordinates of a beacon at c + L (alpha e1 + beta e2), its
bearing is along G a, where G = [R_bw e1, R_bw e2, R_bw (c - r) / L] up to scale: the paper's H
without the plane's distance d from the world origin, by which eq. 33 divides (0 is a normal case).

Four points map a projective basis to a projective basis, so no null vector is searched: with a4 = A
(c1, c2, c3), A = [a1 a2 a3], and X = [x1 x2 x3],

    G = X diag(m1, m2, m3) M,  M = diag(1/c1, 1/c2, 1/c3) A^-1,

m_i = det X with x4 in place of x_i (Cramer's rule times det X). M depends on the beacons alone. The
sign of G puts the beacons along their bearings, not against them: sum x . (G a) > 0. The nearest
orthonormal pair to the two projected columns is their polar factor, U = F (F^T F)^-1/2, whose 2 x 2
root is in closed form; the mean of their singular values is the scale.

B. Triggs, "Autocalibration from planar scenes" (1998), has the projective basis; Y. Ma et al., "An
Invitation to 3-D Vision" (2004), algorithm 5.2, is the four-point algorithm that the paper follows.
"""

from __future__ import annotations

import math

from estimation.poses.bearing_frame import CENTER, PLANE, SIGHTS, right
from quadrotor.compiled import compiled
from quadrotor.records import Array
from quadrotor.vectors import (
    Quaternion,
    Vector,
    along,
    cross,
    dot,
    length,
    normalized,
    scale,
    to_world,
    vector,
)

EDGE_ON = 1e-9
"""Volume (of unit bearings) or sine below which the homography is not determined."""


@compiled(inner=True)
def homography_pose(frame: Array) -> tuple[bool, Vector, Quaternion]:
    """Return whether there is a pose, its position from the plane's centre (m, world axes), and
    q_wb.

    Args:
        frame: (13 + N, 6), see `bearing_frame`; bearings are read, nothing is written.
    """
    extent, last, spanned = right(frame[PLANE + 3])
    one, two, three = right(frame[CENTER])
    x1, x2 = right(frame[SIGHTS + int(one)]), right(frame[SIGHTS + int(two)])
    x3, x4 = right(frame[SIGHTS + int(three)]), right(frame[SIGHTS + int(last)])
    x23, x14 = cross(x2, x3), cross(x1, x4)
    m = (dot(x4, x23), dot(x3, x14), -dot(x2, x14))
    m4 = dot(x1, x23)
    # Bearings are unit vectors, so x . (G a) of each is its own factor.
    if dot(m, vector(frame[PLANE + 3])) + m4 < 0.0:
        m = scale(-1.0, m)
    y = (scale(m[0], x1), scale(m[1], x2), scale(m[2], x3))
    M = (vector(frame[PLANE]), vector(frame[PLANE + 1]), vector(frame[PLANE + 2]))
    g1 = to_world(y, (M[0][0], M[1][0], M[2][0]))
    g2 = to_world(y, (M[0][1], M[1][1], M[2][1]))
    g3 = to_world(y, (M[0][2], M[1][2], M[2][2]))
    a, b, c = dot(g1, g1), dot(g1, g2), dot(g2, g2)
    area = length(cross(g1, g2))
    total = math.sqrt(a + c + 2.0 * area)
    s = 1.0 / (area * total)
    u1 = scale(s, along(scale(c + area, g1), -b, g2))
    u2 = scale(s, along(scale(a + area, g2), -b, g1))
    u3 = cross(u1, u2)
    # Columns of R_wb, the body's axes in world axes, are those of [e1 e2 e3] [u1 u2 u3]^T.
    e = (right(frame[PLANE]), right(frame[PLANE + 1]), right(frame[PLANE + 2]))
    x_b = to_world(e, (u1[0], u2[0], u3[0]))
    y_b = to_world(e, (u1[1], u2[1], u3[1]))
    z_b = to_world(e, (u1[2], u2[2], u3[2]))
    r = to_world((x_b, y_b, z_b), scale(-2.0 * extent / total, g3))
    volume = max(abs(m[0]), abs(m[1]), abs(m[2]), abs(m4))
    seen = spanned > 0.0 and volume > EDGE_ON and area > EDGE_ON * (a + c)
    return seen, r, quaternion_of(x_b, y_b, z_b)


@compiled(inner=True)
def quaternion_of(x: Vector, y: Vector, z: Vector) -> Quaternion:
    """Return the unit quaternion whose matrix has these columns; the largest component is positive.

    The four candidates are the quaternion times four times each of its components; the longest is
    the best conditioned.
    """
    w2, x2 = 1.0 + x[0] + y[1] + z[2], 1.0 + x[0] - y[1] - z[2]
    y2, z2 = 1.0 - x[0] + y[1] - z[2], 1.0 - x[0] - y[1] + z[2]
    wx, wy, wz = y[2] - z[1], z[0] - x[2], x[1] - y[0]
    xy, xz, yz = y[0] + x[1], z[0] + x[2], z[1] + y[2]
    if w2 >= 1.0:
        q = (w2, wx, wy, wz)
    elif x2 >= max(y2, z2):
        q = (wx, x2, xy, xz)
    elif y2 >= z2:
        q = (wy, xy, y2, yz)
    else:
        q = (wz, xz, yz, z2)
    return normalized(q)
