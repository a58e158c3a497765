"""One flight as one compiled call: plant, sensors, filters and laws, and the flight's outcome."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from control.laws import Own, Records, Step
from control.rotor_lead import lead
from control.trajectories.figure_eight import figure_eight_at
from estimation.complementary_filter import predict_one
from extensions.batches.noise import normals
from extensions.batches.onboard import SETTINGS, control, observe_disturbance
from extensions.batches.sensing import TRACKER, read_imu, track
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rigid_body import motor_share
from vehicle.boards.reference_rounding import _round as whole_references
from vehicle.simulator.air import blow
from vehicle.simulator.plant import move
from vehicle.simulator.sensors import SENSORS

Array = npt.NDArray[np.float64]

LATEST = 64
"""Most control periods that a command may be late."""
CRASH_DISTANCE = 2.0
"""Distance, in m, from the reference beyond which the flight is lost."""
CRASH_LEAN = 1.5
"""Largest 1 - z_B . z_W: beyond 120° of tilt the flight is lost."""

PACE = np.dtype(
    [
        ("ticks", "i8"),  # control periods of the flight
        ("period_ns", "i8"),
        ("substeps", "i8"),  # of the plant in a control period
        ("hover_ticks", "i8"),  # before the trajectory begins, and the outcome
        ("judge_every", "i8"),  # ticks between two moments of the outcome's errors
        ("keep_every", "i8"),  # ticks between two records of the history
    ],
    align=True,
)
"""The periods of a flight, all in whole numbers."""

CASE = np.dtype(
    [
        ("pace", PACE),
        ("settings", SETTINGS),
        ("sensors", SENSORS),
        ("tracker", TRACKER),
        ("random", "u8", 4),
        ("drawn", "f8", 6),  # buffer for one sample's random numbers
        ("calibration_samples", "i8"),  # of the gyroscope, before the flight
        ("true_state", "i8"),  # 1: the laws get the true state
        ("whole_references", "i8"),  # 1: motors accept whole counts only
        ("gyroscope_bias_b", "f8", 3),  # rad/s, found by the calibration
        ("other_law", "i8"),  # 1: the law of an extension
        ("leads", "i8"),  # 1: the law gets references that lead the rotors
        ("late", "i8"),  # control periods until a command reaches the motors
        ("sent", "f8", (LATEST, 4)),  # counts, the commands of the last periods
    ],
    align=True,
)
"""One vehicle of a batch next to its PLANT and ONBOARD records."""

OUTCOME = np.dtype(
    [
        ("crashed", "i8"),
        ("crash_time", "f8"),  # s, NaN when it did not
        ("position_rms", "f8"),  # m, true position minus the reference
        ("position_max", "f8"),  # m
        ("yaw_rms", "f8"),  # rad
        ("estimate_rms", "f8"),  # m, true position minus the estimate
        ("saturated_share", "f8"),  # of the control periods, 0..1
        ("tilt_max", "f8"),  # rad
        ("moments", "i8"),  # number of moments evaluated
    ],
    align=True,
)

HISTORY = np.dtype(
    [
        ("time", "f8"),  # s
        ("truth", "f8", 13),  # position_w, velocity_w, quaternion_wb, angular_velocity_b
        ("position_estimate_w", "f8", 3),  # m
        ("position_reference_w", "f8", 3),  # m
        ("yaw_reference", "f8"),  # rad
        ("thrusts", "f8", 4),  # N, commanded
    ],
    align=True,
)


@compiled(inner=True)
def _lead(c: Item, records: Records, snap_w: Array, period: float) -> None:
    """Let the reference lead the rotors, where the law wants that."""
    if c.leads == 1:
        lead(records[1], records[0], records[3], snap_w, period, records[1])


@compiled(inner=True)
def copy_state(x: Any, state: Item) -> None:
    """Copy x (13,) into a STATE record."""
    for i in range(3):
        state.position_w[i] = x[i]
        state.velocity_w[i] = x[3 + i]
        state.angular_velocity_b[i] = x[10 + i]
    for i in range(4):
        state.quaternion_wb[i] = x[6 + i]


@compiled(inner=True)
def _begin(c: Item, p: Item, v: Item) -> None:
    """Set the gyroscope's bias to its mean at rest (Sec. 5.1); start the filter at the truth."""
    bias, rate, n = c.gyroscope_bias_b, v.imu.angular_velocity_b, c.calibration_samples
    for _ in range(n):
        read_imu(p, c.sensors, v.estimator.gyroscope_bias_b, c.random, c.drawn, v.imu)
        for i in range(3):
            bias[i] += rate[i] / n
    e = v.estimator
    e.initialized = 1
    e.pose_stamp_ns = e.newest_ns = -1
    for i in range(3):
        e.pose[i] = p.x[i]
    for i in range(4):
        e.pose[3 + i] = p.x[6 + i]


@compiled(inner=True)
def _judge(x: Any, v: Item, r: Item, weight: int) -> bool:
    """Add `weight` (0 or 1) times this moment to the sums of the OUTCOME record r.

    Returns True when the flight is lost: far from the reference, upside down, or not finite.
    """
    square = missed = 0.0
    for i in range(3):
        e = v.reference.position_w[i] - x[i]
        square += e * e
        e = v.state.position_w[i] - x[i]
        missed += e * e
    w, a, b, c = x[6], x[7], x[8], x[9]
    lean = 2.0 * (a * a + b * b)  # 1 - z_B . z_W
    if not (square < CRASH_DISTANCE**2 and lean < CRASH_LEAN):
        return True
    yaw = math.atan2(2.0 * (w * c + a * b), 1.0 - 2.0 * (b * b + c * c)) - v.reference.yaw
    yaw -= 2.0 * math.pi * math.floor(yaw / (2.0 * math.pi) + 0.5)
    r.moments += weight
    r.position_rms += weight * square
    r.yaw_rms += weight * yaw * yaw
    r.estimate_rms += weight * missed
    r.position_max = max(r.position_max, weight * square)
    r.tilt_max = max(r.tilt_max, weight * lean)
    return False


@compiled(inner=True)
def _finish(r: Item, ticks: int, saturated: int) -> None:
    """Turn sums into means; NaN if no moment was evaluated."""
    r.position_rms = math.sqrt(r.position_rms / r.moments)
    r.yaw_rms = math.sqrt(r.yaw_rms / r.moments)
    r.estimate_rms = math.sqrt(r.estimate_rms / r.moments)
    r.position_max = math.sqrt(r.position_max)
    r.tilt_max = math.acos(max(-1.0, 1.0 - r.tilt_max))
    r.saturated_share = saturated / float(ticks)


@compiled(inner=True)
def _keep(t: float, x: Any, v: Item, h: Item) -> None:
    """Store one HISTORY record."""
    h.time = t
    for i in range(13):
        h.truth[i] = x[i]
    for i in range(3):
        h.position_estimate_w[i] = v.state.position_w[i]
        h.position_reference_w[i] = v.reference.position_w[i]
    h.yaw_reference = v.reference.yaw
    for i in range(4):
        h.thrusts[i] = v.actuators.thrusts[i]


@compiled(inner=True)
def _see(c: Item, p: Item, v: Item, k: int) -> None:
    """Write the state in period k: the true one, or the estimate from this period's sensors."""
    if c.true_state == 1:
        copy_state(p.x, v.state)
        return
    s, e, period_ns = c.settings, v.estimator, c.pace.period_ns
    v.imu.stamp_ns = k * period_ns
    read_imu(p, c.sensors, c.gyroscope_bias_b, c.random, c.drawn, v.imu)
    predict_one(e, v.imu, s.estimation, 1e-9 * period_ns, v.state)
    # A pose acts on the next prediction, as it does in the vehicle's tick.
    track(c.tracker, p, v.imu.stamp_ns, c.random, c.drawn, e, gains=s.estimation, out=v.estimate)


@compiled(inner=True)
def _refer(c: Item, course: Record, k: int, reference: Item) -> None:
    """Write the reference k periods into the trajectory: that of the 8 if `course` is empty."""
    if course.shape[0] == 0:
        figure_eight_at(c.settings.eight, k * 1e-9 * c.pace.period_ns, reference)
        return
    row = course[min(max(0, k), course.shape[0] - 1)]
    for i in range(3):
        reference.position_w[i] = row.position_w[i]
        reference.velocity_w[i] = row.velocity_w[i]
        reference.acceleration_w[i] = row.acceleration_w[i]
        reference.jerk_w[i] = row.jerk_w[i]
        reference.snap_w[i] = row.snap_w[i]
    reference.yaw = row.yaw
    reference.yaw_rate = row.yaw_rate
    reference.yaw_acceleration = row.yaw_acceleration


@compiled(inner=True)
def _meanwhile(c: Item, plant: Record, k: int, wanted: Array, drawn: Array) -> None:
    """Let commands arrive late, and the wind blow, in period k.

    Args:
        wanted: (4,) motor references of this period, overwritten by those that arrive.
        drawn: (1, 3), for random numbers.
    """
    if c.late > 0:
        for i in range(4):
            c.sent[k % LATEST, i] = wanted[i]
            wanted[i] = c.sent[max(0, k - c.late) % LATEST, i]
    if plant[0].gust > 0.0:
        normals(c.random, drawn[0])
        blow(plant, drawn, 0, 1e-9 * c.pace.period_ns)


@compiled(nogil=True)
def fly(
    case: Record,
    plant: Record,
    onboard: Record,
    course: Record,
    outcome: Record,
    history: Record,
    motors: Array,
    law: Step,
    own: Own,
    records: Records,
) -> None:
    """Fly at the case's PACE; records have shape (1,), and all but settings are written.

    One period: sample the sensors, step the laws, hold their motor references over the
    Runge-Kutta steps of the plant.

    Args:
        course: (K,) REFERENCE of each period, the last one held; empty for the 8 of the settings.
        history: (K,) HISTORY, written until it is full.
        motors: (2, 4) counts, the motor references and their carried rounding errors.
        law: called with `own` and `records`, which are parts of case and onboard, where the case's
            law is that of an extension.
    """
    c, p, v, r = case[0], plant[0], onboard[0], outcome[0]
    wanted, carry, pace = motors[0], motors[1], c.pace
    ticks, period, substeps = pace.ticks, 1e-9 * pace.period_ns, pace.substeps
    hover_ticks, judge_every, keep_every = pace.hover_ticks, pace.judge_every, pace.keep_every
    airborne = ticks > 0  # a plain True would be compiled as another type
    dt, drawn, snap_w = period / substeps, np.zeros((1, 3)), np.zeros(3)
    share = motor_share(p.model.motor_time_constant, dt)
    r.crash_time = math.nan
    to_judge = to_keep = kept = flown = saturated = 0
    _begin(c, p, v)
    for k in range(ticks):
        _see(c, p, v, k)
        observe_disturbance(v, c.settings, airborne, period)
        _refer(c, course, k - hover_ticks, v.reference)
        _lead(c, records, snap_w, period)
        if c.other_law == 1:
            law(own, records, airborne, airborne, period)
        else:
            control(v, c.settings, airborne, period)
        if to_keep == 0 and kept < history.shape[0]:
            _keep(k * period, p.x, v, history[kept])
            kept, to_keep = kept + 1, keep_every
        if to_judge == 0:
            to_judge = judge_every
            if _judge(p.x, v, r, 1 if k >= hover_ticks else 0):
                r.crashed, r.crash_time = 1, k * period
                break
        to_judge, to_keep = to_judge - 1, to_keep - 1
        if k >= hover_ticks:
            flown += 1
            saturated += 1 if v.actuators.scaling < 1.0 else 0
        for i in range(4):
            wanted[i] = v.actuators.motor_references[i]
        if c.whole_references == 1:
            whole_references(wanted, carry)
        _meanwhile(c, plant, k, wanted, drawn)
        move(p, (wanted[0], wanted[1], wanted[2], wanted[3]), substeps, dt, share)
    _finish(r, flown, saturated)
