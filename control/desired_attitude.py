"""The desired attitude and its rates from a force and a yaw, Sec. 4.

R_d has z_d along the force, x_d along y_C x z_d with y_C = (-sin yaw, cos yaw, 0), and
y_d = z_d x x_d. For a force above the horizon the ZYX yaw of R_d is the given yaw exactly.
Singular only where the force is parallel to y_C, which the force limits exclude.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]


@njit(cache=True)
def attitude_of_force(force_w: Array, yaw: float, R_wd: Array) -> None:
    """R_d, shape (3, 3), into R_wd.

    Args:
        force_w: (3,) any length but zero, not parallel to y_C.
        yaw: rad.
    """
    length = math.sqrt(force_w[0] ** 2 + force_w[1] ** 2 + force_w[2] ** 2)
    zx, zy, zz = force_w[0] / length, force_w[1] / length, force_w[2] / length
    s, c = math.sin(yaw), math.cos(yaw)
    # y_C x z_d
    xx, xy, xz = c * zz, s * zz, -s * zy - c * zx
    length = math.sqrt(xx * xx + xy * xy + xz * xz)
    xx, xy, xz = xx / length, xy / length, xz / length
    R_wd[0, 0], R_wd[1, 0], R_wd[2, 0] = xx, xy, xz
    R_wd[0, 1], R_wd[1, 1], R_wd[2, 1] = zy * xz - zz * xy, zz * xx - zx * xz, zx * xy - zy * xx
    R_wd[0, 2], R_wd[1, 2], R_wd[2, 2] = zx, zy, zz


@njit(cache=True)
def _unit(a: Array, out: Array) -> None:
    """Rows u, u', u'' of u = a / |a| from rows a, a', a''; both (3, 3).

    |a|' = u . a', u' = (a' - u |a|') / |a|, |a|'' = u' . a' + u . a'',
    u'' = (a'' - 2 u' |a|' - u |a|'') / |a|.
    """
    n, n1, n2 = math.sqrt(a[0, 0] ** 2 + a[0, 1] ** 2 + a[0, 2] ** 2), 0.0, 0.0
    for i in range(3):
        out[0, i] = a[0, i] / n
        n1 += out[0, i] * a[1, i]
    for i in range(3):
        out[1, i] = (a[1, i] - out[0, i] * n1) / n
        n2 += out[1, i] * a[1, i] + out[0, i] * a[2, i]
    for i in range(3):
        out[2, i] = (a[2, i] - 2.0 * out[1, i] * n1 - out[0, i] * n2) / n


@njit(cache=True)
def _cross(a: Array, b: Array, out: Array) -> None:
    """Rows (a x b), (a x b)', (a x b)'' from rows of a and b; all (3, 3)."""
    for k in range(3):
        for i in range(3):
            out[k, i] = 0.0
        for m in range(k + 1):
            weight = 2.0 if k == 2 and m == 1 else 1.0  # Leibniz
            for i in range(3):
                j, l = (i + 1) % 3, (i + 2) % 3  # noqa: E741 - i, j, l cyclic
                out[k, i] += weight * (a[m, j] * b[k - m, l] - a[m, l] * b[k - m, j])


@njit(cache=True)
def attitude_rates(
    force: Array, yaw: float, yaw_rate: float, yaw_acceleration: float, w_d: Array, w_dot_d: Array
) -> None:
    """omega_d = (R_d^T R_d')^v and its derivative (R_d^T R_d'')^v, in axes of R_d.

    R'' = R (hat(w') + hat(w)^2) and hat(w)^2 is symmetric, so the skew part of R^T R'' is w'.

    Args:
        force: (3, 3) rows f (N), f', f'' in world axes.
        yaw, yaw_rate, yaw_acceleration: rad, rad/s, rad/s^2.
        w_d, w_dot_d: (3,) outputs, rad/s and rad/s^2.
    """
    x, y, z, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3))
    _unit(force, z)
    s, c = math.sin(yaw), math.cos(yaw)
    work[0, 0], work[0, 1] = -s, c
    work[1, 0], work[1, 1] = -c * yaw_rate, -s * yaw_rate
    work[2, 0] = -c * yaw_acceleration + s * yaw_rate * yaw_rate
    work[2, 1] = -s * yaw_acceleration - c * yaw_rate * yaw_rate
    _cross(work, z, y)
    _unit(y, x)
    _cross(z, x, y)
    for i in range(3):
        w_d[i] = 0.0
        w_dot_d[i] = 0.0
    for i in range(3):
        w_d[0] += z[0, i] * y[1, i]
        w_d[1] += x[0, i] * z[1, i]
        w_d[2] += y[0, i] * x[1, i]
        w_dot_d[0] += 0.5 * (z[0, i] * y[2, i] - y[0, i] * z[2, i])
        w_dot_d[1] += 0.5 * (x[0, i] * z[2, i] - z[0, i] * x[2, i])
        w_dot_d[2] += 0.5 * (y[0, i] * x[2, i] - x[0, i] * y[2, i])
