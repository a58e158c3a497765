"""The desired attitude and its rates from a force and a yaw, Sec. 4.

R_d has z_d along the force, x_d along y_C x z_d with y_C = (-sin yaw, cos yaw, 0), and
y_d = z_d x x_d. For a force above the horizon the ZYX yaw of R_d is the given yaw exactly.
Singular only where the force is parallel to y_C, which the force limits exclude.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled
def _unit(a: Array, out: Array) -> None:
    """Rows u, u', u'' of u = a / |a| from rows a, a', a''; both (3, 3).

    |a|' = u . a', u' = (a' - u |a|') / |a|, |a|'' = u' . a' + u . a'',
    u'' = (a'' - 2 u' |a|' - u |a|'') / |a|.
    """
    n = math.sqrt(a[0, 0] * a[0, 0] + a[0, 1] * a[0, 1] + a[0, 2] * a[0, 2])
    n1 = 0.0
    n2 = 0.0
    for i in range(3):
        out[0, i] = a[0, i] / n
        n1 += out[0, i] * a[1, i]
    for i in range(3):
        out[1, i] = (a[1, i] - out[0, i] * n1) / n
        n2 += out[1, i] * a[1, i] + out[0, i] * a[2, i]
    for i in range(3):
        out[2, i] = (a[2, i] - 2.0 * out[1, i] * n1 - out[0, i] * n2) / n


@compiled
def _cross(a: Array, b: Array, out: Array) -> None:
    """Rows (a x b), (a x b)', (a x b)'' from rows of a and b; all (3, 3)."""
    for i in range(3):
        j = i + 1 if i < 2 else 0
        k = j + 1 if j < 2 else 0
        out[0, i] = a[0, j] * b[0, k] - a[0, k] * b[0, j]
        out[1, i] = a[1, j] * b[0, k] - a[1, k] * b[0, j] + a[0, j] * b[1, k] - a[0, k] * b[1, j]
        out[2, i] = (
            (a[2, j] * b[0, k] - a[2, k] * b[0, j])
            + 2.0 * (a[1, j] * b[1, k] - a[1, k] * b[1, j])
            + (a[0, j] * b[2, k] - a[0, k] * b[2, j])
        )


@compiled
def attitude_of_force(
    force: Array,
    yaw: float,
    yaw_rate: float,
    yaw_acceleration: float,
    R_wd: Array,
    w_d: Array,
    w_dot_d: Array,
) -> None:
    """R_d, omega_d = (R_d^T R_d')^v and omega_d' = (R_d^T R_d'')^v, the rates in axes of R_d.

    R'' = R (hat(w') + hat(w)^2) and hat(w)^2 is symmetric, so the skew part of R^T R'' is w'.

    Args:
        force: (3, 3) rows f (N), f', f'' in world axes; f not zero, not parallel to y_C.
        yaw, yaw_rate, yaw_acceleration: rad, rad/s, rad/s^2.
        R_wd: (3, 3) output.
        w_d, w_dot_d: (3,) outputs, rad/s and rad/s^2.
    """
    x = np.empty((3, 3))
    y = np.empty((3, 3))
    z = np.empty((3, 3))
    y_c = np.zeros((3, 3))
    s = math.sin(yaw)
    c = math.cos(yaw)
    y_c[0, 0] = -s
    y_c[0, 1] = c
    y_c[1, 0] = -c * yaw_rate
    y_c[1, 1] = -s * yaw_rate
    y_c[2, 0] = -c * yaw_acceleration + s * yaw_rate * yaw_rate
    y_c[2, 1] = -s * yaw_acceleration - c * yaw_rate * yaw_rate
    _unit(force, z)
    _cross(y_c, z, y)
    _unit(y, x)
    _cross(z, x, y)
    for i in range(3):
        w_d[i] = 0.0
        w_dot_d[i] = 0.0
    for i in range(3):
        R_wd[i, 0] = x[0, i]
        R_wd[i, 1] = y[0, i]
        R_wd[i, 2] = z[0, i]
        w_d[0] += z[0, i] * y[1, i]
        w_d[1] += x[0, i] * z[1, i]
        w_d[2] += y[0, i] * x[1, i]
        w_dot_d[0] += 0.5 * (z[0, i] * y[2, i] - y[0, i] * z[2, i])
        w_dot_d[1] += 0.5 * (x[0, i] * z[2, i] - z[0, i] * x[2, i])
        w_dot_d[2] += 0.5 * (y[0, i] * x[2, i] - x[0, i] * y[2, i])
