"""The torques, eq. 5: PID on SO(3), gyroscopic cancellation and feed-forward."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from control.parameters import Item
from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]


@compiled
def attitude_torque(
    R_wb: Array,
    w_b: Array,
    R_wd: Array,
    w_d: Array,
    w_dot_d: Array,
    integral_b: Array,
    gains: Item,
    J: Array,
    e_R: Array,
    out: Array,
) -> None:
    """Torque (N m, body axes, (3,)) of eq. 5 into out[1:4], the attitude error into e_R (3,).

    The feed-forward carries the desired rates from axes of R_d to body axes with E = R^T R_d.
    Gains are per unit inertia; K_f is the integral gain.

    Args:
        R_wb, R_wd: (3, 3) attitude and desired attitude.
        w_b: (3,) rad/s, body axes.
        w_d, w_dot_d: (3,) rad/s and rad/s^2, axes of R_d.
        integral_b: (3,) rad s, the integral of e_R.
        gains: one CONTROL record.
        J: (3,) diagonal inertia, kg m^2.
        out: (4,) the wrench; its thrust is left alone.
    """
    E = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                E[i, j] += R_wb[k, i] * R_wd[k, j]
    for i in range(3):
        j = i + 1 if i < 2 else 0
        l = j + 1 if j < 2 else 0  # noqa: E741 - i, j, l cyclic
        e_R[i] = 0.5 * (E[l, j] - E[j, l])
        w = 0.0
        w_j = 0.0
        w_l = 0.0
        w_dot = 0.0
        for k in range(3):
            w += E[i, k] * w_d[k]
            w_j += E[j, k] * w_d[k]
            w_l += E[l, k] * w_d[k]
            w_dot += E[i, k] * w_dot_d[k]
        feedback = gains.kr[i] * e_R[i] + gains.kf[i] * integral_b[i] + gains.kw[i] * (w - w_b[i])
        transport = w_b[j] * w_l - w_b[l] * w_j  # omega x (E omega_d)
        gyroscopic = w_b[j] * J[l] * w_b[l] - w_b[l] * J[j] * w_b[j]
        out[1 + i] = J[i] * (feedback + w_dot - transport) + gyroscopic
