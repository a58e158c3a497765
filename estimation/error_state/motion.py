"""Prediction of nominal state and covariance along the IMU samples.

The true state obeys p' = v, v' = R (f - b_a) + g, R' = R [w - b_g]. Errors as in `memory` (world
axes, R_true = exp(phi) R) then obey, to first order, with a = R (f - b_a) the specific force in
world axes,

    dp' = dv,    dv' = phi x a - R db_a,    phi' = -R db_g,

and the biases follow random walks. Only a and R enter, not the yaw by itself, so a turned world
gives turned results. Between two samples, rate and force are linear in time.
"""

from __future__ import annotations

from estimation.error_state.memory import ERRORS, FORCE, RATE, SAMPLES
from quadrotor.compiled import compiled
from quadrotor.records import Array, Item
from quadrotor.vectors import (
    Vector,
    add,
    axes_of,
    cross,
    normalized,
    scale,
    subtract,
    to_world,
    turned,
    vector,
)
from quadrotor.vehicle_model import GRAVITY

_MASK = SAMPLES - 1


@compiled(inner=True)
def move(x: Array, start_b: Vector, end_b: Vector, rate_b: Vector, dt: float) -> None:
    """Advance a nominal state (16,) in place by samples that include their biases.

    The force changes from start_b to end_b, the rate is held; the time dt is in s.
    """
    q = (x[6], x[7], x[8], x[9])
    bias = (x[13], x[14], x[15])
    a = to_world(axes_of(q), subtract(start_b, bias))
    turn = (dt * (rate_b[0] - x[10]), dt * (rate_b[1] - x[11]), dt * (rate_b[2] - x[12]))
    q = normalized(turned(q, turn))
    b = to_world(axes_of(q), subtract(end_b, bias))
    for i in range(3):
        x[i] += dt * (x[3 + i] + dt * (2.0 * a[i] + b[i]) / 6.0)
        x[3 + i] += 0.5 * dt * (a[i] + b[i])
    x[2] -= 0.5 * dt * dt * GRAVITY
    x[5] -= dt * GRAVITY
    x[6], x[7], x[8], x[9] = q


@compiled(inner=True)
def spread(P: Array, x: Array, force_b: Vector, g: Item, noise_scale: Array, dt: float) -> None:
    """Propagate the covariance P (15, 15) -> F P F^T + Q over dt (s) about the nominal state x
    (16,).

    The effect of a gyroscope bias on the velocity within dt is neglected: it is of second order in
    dt.

    Args:
        noise_scale: factors on the noise variances of g, by kind of noise.
    """
    axes = axes_of((x[6], x[7], x[8], x[9]))
    a = to_world(axes, subtract(force_b, (x[13], x[14], x[15])))
    half = 0.5 * dt * dt
    for _ in range(2):  # F P, transposed; twice is F P F^T
        for j in range(ERRORS):
            c = cross((P[3, j], P[4, j], P[5, j]), a)
            c = subtract(c, to_world(axes, (P[12, j], P[13, j], P[14, j])))
            r = to_world(axes, (P[9, j], P[10, j], P[11, j]))
            for i in range(3):
                P[i, j] += dt * P[6 + i, j] + half * c[i]
                P[6 + i, j] += dt * c[i]
                P[3 + i, j] -= dt * r[i]
        for i in range(1, ERRORS):
            for j in range(i):
                P[i, j], P[j, i] = P[j, i], P[i, j]
    for i in range(3):
        P[3 + i, 3 + i] += dt * noise_scale[RATE] * g.gyroscope_noise**2
        P[6 + i, 6 + i] += dt * noise_scale[FORCE] * g.accelerometer_noise**2
        P[9 + i, 9 + i] += dt * g.gyroscope_bias_walk**2
        P[12 + i, 12 + i] += dt * g.accelerometer_bias_walk**2


@compiled(inner=True)
def walk(m: Item, x: Array, from_ns: int, to_ns: int, g: Item, with_covariance: bool) -> None:
    """Advance x (16,), and optionally the covariance, along the stored samples.

    A time before the oldest sample uses the oldest, one after the newest uses the newest.
    """
    stamps, samples = m.sample_ns, m.sample
    newest = (m.sample_next - 1) & _MASK
    back, most = 0, max(0, m.sample_count - 1)  # steps back to the last sample not after from_ns
    while back < most:
        half = (back + most) // 2
        if stamps[(newest - half) & _MASK] > from_ns:
            back = half + 1
        else:
            most = half
    i = (newest - back) & _MASK
    t = from_ns
    while t < to_ns:
        j = i if i == newest else (i + 1) & _MASK
        end = to_ns if j == i else min(stamps[j], to_ns)
        span = float(max(1, stamps[j] - stamps[i]))
        s = max(0.0, (t - stamps[i]) / span)
        e = (end - stamps[i]) / span
        old, new = samples[i], samples[j]
        force, rate = vector(old[3:]), vector(old)
        slope = subtract(vector(new[3:]), force)
        bend = subtract(vector(new), rate)
        dt = 1e-9 * (end - t)
        if with_covariance:
            spread(m.covariance, x, add(force, scale(0.5 * (s + e), slope)), g, m.noise_scale, dt)
        start, stop = add(force, scale(s, slope)), add(force, scale(e, slope))
        move(x, start, stop, add(rate, scale(0.5 * (s + e), bend)), dt)
        t, i = end, j
