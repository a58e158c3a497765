"""The equations of the laws once more, in NumPy with matrices, to compare the compiled ones with.

They share no code with the laws: each class is one law with its memory, for one vehicle.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
G, Z = 9.81, np.array([0.0, 0.0, 1.0])
LIFT_MIN, DIRECTION_MIN = 0.3, 0.1


def hat(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def vee(A: Array) -> Array:
    return np.array([A[2, 1], A[0, 2], A[1, 0]])


def matrix(q: Array) -> Any:
    w, v = q[0], np.asarray(q[1:])
    return (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * hat(v)


def product(p: Array, q: Array) -> Array:
    return np.concatenate(
        [[p[0] * q[0] - p[1:] @ q[1:]], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])]
    )


class Motion:
    """A vector or matrix with its first two time derivatives."""

    def __init__(self, a: Any, b: Any, c: Any) -> None:
        self.a, self.b, self.c = map(np.asarray, (a, b, c))

    def cross(self, o: Motion) -> Motion:
        return Motion(
            np.cross(self.a, o.a),
            np.cross(self.b, o.a) + np.cross(self.a, o.b),
            np.cross(self.c, o.a) + 2.0 * np.cross(self.b, o.b) + np.cross(self.a, o.c),
        )

    def unit(self) -> Motion:
        # s = (a . a)^(-1/2), and u = s a by the product rule
        n, n1 = self.a @ self.a, 2.0 * self.a @ self.b
        n2 = 2.0 * (self.b @ self.b + self.a @ self.c)
        s, s1 = n**-0.5, -0.5 * n**-1.5 * n1
        s2 = 0.75 * n**-2.5 * n1**2 - 0.5 * n**-1.5 * n2
        return Motion(
            s * self.a, s1 * self.a + s * self.b, s2 * self.a + 2.0 * s1 * self.b + s * self.c
        )


def attitude(force: Motion, r: Any) -> tuple[Array, Array, Array]:
    """Return R_d, omega_d and omega_d' of a force and the reference's yaw."""
    s, c, w = np.sin(r.yaw), np.cos(r.yaw), r.yaw_rate
    y = Motion(
        [-s, c, 0.0],
        [-c * w, -s * w, 0.0],
        [-c * r.yaw_acceleration + s * w * w, -s * r.yaw_acceleration - c * w * w, 0.0],
    )
    z = force.unit()
    x = y.cross(z).unit()
    y = z.cross(x)
    R, R1, R2 = (np.stack([getattr(m, n) for m in (x, y, z)], 1) for n in "abc")
    omega = vee(R.T @ R1)
    return R, omega, vee(R.T @ R2 - hat(omega) @ hat(omega))


def limited(f: Array, weight: float, tan_tilt: float) -> Array:
    f = f.copy()
    f[2] = max(f[2], LIFT_MIN * weight)
    sideways = np.hypot(f[0], f[1])
    f[:2] *= min(1.0, f[2] * tan_tilt / sideways) if sideways > 0.0 else 1.0
    return f


def mixing(model: Any) -> Any:
    l, c = model.arm, model.torque_ratio  # noqa: E741
    return np.array([[1, 1, 1, 1], [0, l, 0, -l], [-l, 0, l, 0], [c, -c, c, -c]], float)


def allocated(thrust: Any, torque: Array, gains: Any, model: Any) -> tuple[Array, float]:
    """Return the wrench within the motors' limits, and the scaling."""
    bound, M = gains.yaw_torque_max, mixing(model)
    u = np.array([max(thrust, 0.0), torque[0], torque[1], np.clip(torque[2], -bound, bound)])
    g = np.full(4, np.clip(0.25 * model.mass * G, model.thrust_min, model.thrust_max))
    rest = np.linalg.solve(M, u) - g
    room = np.where(rest > 0.0, model.thrust_max - g, model.thrust_min - g)
    share = min(1.0, min((room / rest)[rest != 0.0], default=1.0))
    return M @ (g + share * rest), share


def plain(record: Any) -> Any:
    """Return a record (1,) with its fields as attributes: numbers and arrays."""
    return SimpleNamespace(**{n: np.array(record[n][0]) for n in record.dtype.names})


class Rotors:
    """The rotors' model, driven by the last commands."""

    def __init__(self, references: Array) -> None:
        self.speeds = references.copy()

    def wrench(self, references: Array, model: Any, dt: float, *, middle: bool) -> Any:
        before = self.speeds
        fade = np.exp(-dt / model.motor_time_constant)
        self.speeds = references + fade * (before - references)
        return self.now(model, 0.5 * (before + self.speeds) if middle else self.speeds)

    def now(self, model: Any, n: Array | None = None) -> Any:
        n = self.speeds if n is None else n
        root = np.where(n > 1.0, model.motor_slope * (n + model.motor_offset), 0.0)
        return mixing(model) @ np.maximum(root, 0.0) ** 2


def errors(x: Any, r: Any) -> tuple[Array, Array]:
    return r.position_w - x.position_w, r.velocity_w - x.velocity_w


def feed_forward(r: Any, model: Any) -> Motion:
    d = model.drag / model.mass
    return Motion(
        r.acceleration_w + d * r.velocity_w,
        r.jerk_w + d * r.acceleration_w,
        r.snap_w + d * r.jerk_w,
    )


def pd_turn(R: Array, w: Array, D: Array, rates: tuple[Array, Array], gains: Any) -> Any:
    """Return K_R e_R + K_w (E w_d - w) + E w_d' - w x E w_d."""
    e_R = 0.5 * vee(R.T @ D - D.T @ R)
    E = R.T @ D
    wanted, turn = E @ rates[0], E @ rates[1]
    return gains.kr * e_R + gains.kw * (wanted - w) + turn - np.cross(w, wanted)


class PidCascade:
    def __init__(self) -> None:
        self.I_v, self.I_w, self.turn = np.zeros(3), np.zeros(3), np.zeros(3)
        self.before: Array | None = None

    def step(self, s: Any, x: Any, r: Any, k: Any, m: Any, last: Any, dt: float) -> Any:
        R, w = matrix(x.quaternion_wb), x.angular_velocity_b
        before = w if self.before is None else self.before
        self.turn += (1.0 - np.exp(-s.rate_cutoff * dt)) * ((w - before) / dt - self.turn)
        self.before = w
        axis = np.array
        e_p, _ = errors(x, r)
        v_d = r.velocity_w + axis([s.position_p_xy, s.position_p_xy, s.position_p_z]) * e_p
        e_v = v_d - x.velocity_w
        P_v = axis([s.velocity_p_xy, s.velocity_p_xy, s.velocity_p_z])
        wanted = m.mass * (r.acceleration_w + P_v * e_v + self.I_v + G * Z)
        f = limited(wanted, m.mass * G, k.tan_tilt_max)
        D, _, _ = attitude(Motion(f, np.zeros(3), np.zeros(3)), r)
        # The rotation to D: tilt by the shortest way, then what is left, about z.
        z, z_d = R[:, 2], D[:, 2]
        angle = np.arctan2(np.linalg.norm(np.cross(z, z_d)), z @ z_d)
        axis_w = np.cross(z, z_d) / np.linalg.norm(np.cross(z, z_d))
        tilt = (
            np.eye(3)
            + np.sin(angle) * hat(axis_w)
            + (1 - np.cos(angle)) * hat(axis_w) @ hat(axis_w)
        )
        left = (tilt @ R).T @ D
        yaw = 0.4 * np.arctan2(left[1, 0], left[0, 0])
        turned = np.array(
            [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
        )
        E = R.T @ tilt @ R @ turned
        size = np.arctan2(np.linalg.norm(vee(E - E.T)), np.trace(E) - 1.0)
        q_e = np.sin(0.5 * size) * vee(E - E.T) / np.linalg.norm(vee(E - E.T))
        P_q = axis([s.attitude_p_xy, s.attitude_p_xy, s.attitude_p_z / 0.4])
        e_w = P_q * 2.0 * q_e + R.T @ (r.yaw_rate * Z) - w
        nu = axis([s.rate_p_xy, s.rate_p_xy, s.rate_p_z]) * e_w
        nu -= axis([s.rate_d, s.rate_d, 0.0]) * self.turn
        wrench, share = allocated(f @ R[:, 2], m.inertia_b * (nu + self.I_w), k, m)
        if share == 1.0 and np.array_equal(f, wanted):
            I_v = axis([s.velocity_i_xy, s.velocity_i_xy, s.velocity_i_z])
            I_w = axis([s.rate_i_xy, s.rate_i_xy, s.rate_i_z])
            self.I_v = np.clip(self.I_v + I_v * e_v * dt, -4.0, 4.0)
            self.I_w = np.clip(self.I_w + I_w * e_w * dt, -8.0, 8.0)
        return wrench


class Adaptation:
    """sigma^ of force over mass and of torque over inertia, behind C(s)."""

    def __init__(self, x: Any, last: Any) -> None:
        self.rotors, self.v, self.w = (
            Rotors(last.motor_references),
            x.velocity_w.copy(),
            x.angular_velocity_b.copy(),
        )
        self.e_v, self.e_w, self.push, self.turn, self.across, self.t = np.zeros((6, 3))
        self.slow, self.rate, self.slow_rate = np.zeros((3, 3))
        self.lift = 0.0

    def step(self, poles: Any, cutoffs: Any, x: Any, m: Any, last: Any, dt: float) -> None:
        R, w, J = matrix(x.quaternion_wb), x.angular_velocity_b, m.inertia_b
        u = self.rotors.wrench(last.motor_references, m, dt, middle=True)
        z = R[:, 2]
        # The attitude in the middle of the period, to first order.
        direction = z - 0.5 * dt * R @ np.cross(w, Z)
        drag = m.drag / m.mass * x.velocity_w
        # Thrust less drag along z_B is what turns with it.
        v_dot = u[0] / m.mass * direction - G * Z - drag
        twist = m.drag_lever * np.cross(Z, -m.drag * R.T @ x.velocity_w)
        w_dot = (u[1:] + twist - np.cross(w, J * w)) / J
        a, b = poles
        self.v = self.v + dt * (v_dot + self.push - a * self.e_v)
        self.w = self.w + dt * (w_dot + self.turn - b * self.e_w)
        self.e_v, self.e_w = self.v - x.velocity_w, self.w - w
        phi = (np.exp(-a * dt) - 1.0) / -a, (np.exp(-b * dt) - 1.0) / -b
        self.push = -np.exp(-a * dt) * self.e_v / phi[0]
        self.turn = -np.exp(-b * dt) * self.e_w / phi[1]
        keep = 1.0 - np.exp(-cutoffs[0] * dt)
        self.t = self.t + (1.0 - np.exp(-cutoffs[1] * dt)) * (self.turn - self.t)
        self.lift = self.lift + keep * (self.push @ z - self.lift)
        self.across = self.across + keep * (self.push - (self.push @ z) * z - self.across)
        blur = 1.0 - np.exp(-20.0 * dt)
        self.slow = self.slow + blur * (self.across - self.slow)
        self.rate = 20.0 * (self.across - self.slow)
        self.slow_rate = self.slow_rate + blur * (self.rate - self.slow_rate)
        self.curve = 20.0 * (self.rate - self.slow_rate)


class Geometric:
    """The paper's law, eqs. 4 and 5, less an estimated disturbance: force, its rates, torque."""

    def __init__(self) -> None:
        self.integral_w, self.integral_b = np.zeros(3), np.zeros(3)

    def step(self, off: Any, x: Any, r: Any, k: Any, m: Any, dt: float) -> tuple[Array, float]:
        R, w, J = matrix(x.quaternion_wb), x.angular_velocity_b, m.inertia_b
        n, (e_p, e_v) = feed_forward(r, m), errors(x, r)
        across_w = off.force_w - off.lift * R[:, 2]
        n = Motion(
            n.a - across_w / m.mass,
            n.b - off.force_rate_w / m.mass,
            n.c - off.force_curve_w / m.mass,
        )
        wanted = m.mass * (n.a + k.kp * e_p + k.kv * e_v + k.ki * self.integral_w + G * Z)
        f = limited(wanted, m.mass * G, k.tan_tilt_max)
        D, _, _ = attitude(Motion(f, np.zeros(3), np.zeros(3)), r)
        rates = attitude(Motion(n.a + G * Z, n.b, n.c), r)[1:]
        turn = pd_turn(R, w, D, rates, k) + k.kf * self.integral_b
        torque = off.torque_b - m.drag * m.drag_lever * np.cross(Z, R.T @ r.velocity_w)
        wrench, share = allocated(
            f @ R[:, 2] - off.lift, J * turn + np.cross(w, J * w) - torque, k, m
        )
        if share == 1.0 and np.array_equal(f, wanted):
            bounds = k.position_integral_max, k.attitude_integral_max
            self.integral_w = np.clip(self.integral_w + e_p * dt, -bounds[0], bounds[0])
            turned = 0.5 * vee(R.T @ D - D.T @ R)
            self.integral_b = np.clip(self.integral_b + turned * dt, -bounds[1], bounds[1])
        return wrench, share


class GeometricL1:
    def __init__(self) -> None:
        self.adaptation: Adaptation | None = None

    def step(self, s: Any, x: Any, r: Any, k: Any, m: Any, last: Any, dt: float) -> Any:
        R, w, J = matrix(x.quaternion_wb), x.angular_velocity_b, m.inertia_b
        if self.adaptation is None:
            self.adaptation = Adaptation(x, last)
        d = self.adaptation
        poles, cutoffs = (s.force_pole, s.torque_pole), (s.force_cutoff, s.torque_cutoff)
        d.step(poles, cutoffs, x, m, last, dt)
        force = np.clip(m.mass * d.across, -s.force_max, s.force_max)
        is_free = abs(m.mass * d.across) < s.force_max
        torque = np.clip(J * d.t, -s.torque_max, s.torque_max)
        n = feed_forward(r, m)
        rate, curve = np.where(is_free, d.rate, 0.0), np.where(is_free, d.curve, 0.0)
        n = Motion(n.a - force / m.mass, n.b - rate, n.c - curve)
        e_p, e_v = errors(x, r)
        f = m.mass * (n.a + k.kp * e_p + k.kv * e_v + G * Z)
        f = limited(f, m.mass * G, k.tan_tilt_max)
        D, _, _ = attitude(Motion(f, np.zeros(3), np.zeros(3)), r)
        rates = attitude(Motion(n.a + G * Z, n.b, n.c), r)[1:]
        forward_b = -m.drag * R.T @ r.velocity_w
        off = torque + m.drag_lever * np.cross(Z, forward_b)
        tau = J * pd_turn(R, w, D, rates, k) + np.cross(w, J * w) - off
        lift = np.clip(m.mass * d.lift, -s.force_max, s.force_max)
        return allocated(f @ R[:, 2] - lift, tau, k, m)[0]


class Filter:
    """s = w^2 / (s^2 + 2 d w s + w^2), by the semi-implicit step."""

    def __init__(self, value: Array) -> None:
        self.value, self.rate = value.copy(), np.zeros(3)

    def step(self, value: Array, cutoff: Any, damping: float, dt: float) -> None:
        self.rate = self.rate + dt * (
            cutoff**2 * (value - self.value) - 2.0 * damping * cutoff * self.rate
        )
        self.value = self.value + dt * self.rate


class Indi:
    def __init__(self) -> None:
        self.rotors: Rotors | None = None
        self.integral = np.zeros(3)

    def sense(self, s: Any, x: Any, m: Any, last: Any, dt: float) -> Any:
        refs = last.motor_references
        is_first = self.rotors is None
        if self.rotors is None:
            self.rotors = Rotors(refs)
        u = self.rotors.wrench(refs, m, dt, middle=False)
        if is_first:
            self.omega, self.torque = Filter(x.angular_velocity_b), Filter(u[1:])
        cutoff = np.array([s.cutoff, s.cutoff, s.yaw_cutoff])
        self.omega.step(x.angular_velocity_b, cutoff, s.damping, dt)
        self.torque.step(u[1:], cutoff, s.damping, dt)
        return u

    def fly(self, f: Array, x: Any, r: Any, k: Any, m: Any) -> tuple[Array, float]:
        R, n = matrix(x.quaternion_wb), feed_forward(r, m)
        D, _, _ = attitude(Motion(f, np.zeros(3), np.zeros(3)), r)
        rates = attitude(Motion(n.a + G * Z, n.b, n.c), r)[1:]
        nu = pd_turn(R, x.angular_velocity_b, D, rates, k)
        tau = self.torque.value + m.inertia_b * (nu - self.omega.rate)
        return allocated(f @ R[:, 2], tau, k, m)

    def step(self, s: Any, x: Any, r: Any, k: Any, m: Any, last: Any, dt: float) -> Any:
        self.sense(s, x, m, last, dt)
        e_p, e_v = errors(x, r)
        wanted = feed_forward(r, m).a + k.kp * e_p + k.kv * e_v + k.ki * self.integral + G * Z
        f = limited(m.mass * wanted, m.mass * G, k.tan_tilt_max)
        wrench, share = self.fly(f, x, r, k, m)
        if share == 1.0 and np.array_equal(f, m.mass * wanted):
            bound = k.position_integral_max
            self.integral = np.clip(self.integral + e_p * dt, -bound, bound)
        return wrench


class FlatnessIndi(Indi):
    def step(self, s: Any, x: Any, r: Any, k: Any, m: Any, last: Any, dt: float) -> Any:
        is_first = self.rotors is None
        u = self.sense(s, x, m, last, dt)
        thrust_w = u[0] * matrix(x.quaternion_wb)[:, 2] / m.mass
        if is_first:
            self.velocity, self.force = Filter(x.velocity_w), Filter(thrust_w)
        self.velocity.step(x.velocity_w, s.force_cutoff, s.damping, dt)
        self.force.step(thrust_w, s.force_cutoff, s.damping, dt)
        e_p, e_v = errors(x, r)
        a_c = r.acceleration_w + k.kp * e_p + k.kv * e_v
        wanted = m.mass * (self.force.value + a_c - self.velocity.rate)
        return self.fly(limited(wanted, m.mass * G, k.tan_tilt_max), x, r, k, m)[0]


LAWS: dict[str, type[Any]] = {
    "pid_cascade": PidCascade,
    "geometric_l1": GeometricL1,
    "indi": Indi,
    "flatness_indi": FlatnessIndi,
}


def rotation(a: Array) -> Array:
    """Return the unit quaternion of a rotation vector."""
    size = np.linalg.norm(a)
    return np.concatenate([[np.cos(0.5 * size)], 0.5 * np.sinc(0.5 * size / np.pi) * a])


def log(q: Array) -> Array:
    """Return the rotation vector of a unit quaternion."""
    q = q if q[0] >= 0.0 else -q
    size = np.linalg.norm(q[1:])
    return q[1:] * (2.0 * np.arctan2(size, q[0]) / size if size > 1e-12 else 2.0)


def inverse(q: Array) -> Array:
    return q * [1.0, -1.0, -1.0, -1.0]


def quaternion_of(R: Array) -> Array:
    """Return the unit quaternion of a rotation by less than half a turn."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    return np.concatenate([[w], vee(R - R.T) / (4.0 * w)])


class Nmpc:
    N = 20

    def __init__(self) -> None:
        self.x: list[Array] | None = None
        self.adaptation: Adaptation | None = None

    def plan(self, r: Any, m: Any, h: float) -> None:
        d, J = m.drag / m.mass, m.inertia_b
        v, a, j, s = r.velocity_w, r.acceleration_w, r.jerk_w, r.snap_w
        over = (0.25 * self.N * h) ** 2
        w = np.sqrt(np.maximum(0.0, -(v * j + over * a * s) / (v * v + over * a * a)))
        rest = j + w * w * v, s + w * w * a  # what of jerk and snap is not harmonic
        self.x_r, self.u_r = [], []
        for k in range(self.N + 1):
            t = k * h + m.motor_time_constant
            # int sin(w t), with its derivatives, as series: right for w = 0, too
            S, C = t * np.sinc(w * t / np.pi), np.cos(w * t)
            versed = t * t / 2 * np.sinc(w * t / 2 / np.pi) ** 2
            v_h, a_h = v * C + a * S, a * C - w * w * v * S
            p = r.position_w + v * S + a * versed + t**3 / 6 * rest[0] + t**4 / 24 * rest[1]
            v_t = v_h + t * t / 2 * rest[0] + t**3 / 6 * rest[1]
            a_t = a_h + t * rest[0] + t * t / 2 * rest[1]
            j_t, s_t = -w * w * v_h + rest[0] + t * rest[1], -w * w * a_h + rest[1]
            f = a_t + d * v_t + G * Z - self.across
            f[2] = max(f[2], DIRECTION_MIN * G)
            yaw = SimpleNamespace(
                yaw=r.yaw + t * r.yaw_rate + t * t / 2 * r.yaw_acceleration,
                yaw_rate=r.yaw_rate + t * r.yaw_acceleration,
                yaw_acceleration=r.yaw_acceleration,
            )
            R, omega, turn = attitude(Motion(f, j_t + d * a_t, s_t + d * j_t), yaw)
            self.x_r.append(np.concatenate([p, v_t, quaternion_of(R), omega]))
            torque = J * (turn - self.spin) + np.cross(omega, J * omega)
            wrench = np.array([m.mass * (np.linalg.norm(f) - self.lift), *torque])
            self.u_r.append(np.linalg.solve(mixing(m), wrench))

    def turn(self, omega: Array, u: Array, m: Any) -> Any:
        torque = (mixing(m) @ u)[1:]
        return (torque - np.cross(omega, m.inertia_b * omega)) / m.inertia_b + self.spin

    def next(self, x: Array, u: Array, m: Any, h: float) -> Array:
        q, omega, turn = x[6:10], x[10:], self.turn(x[10:], u, m)
        middle = matrix(product(q, rotation(h / 2 * omega + h * h / 8 * turn)))
        a = (u.sum() / m.mass + self.lift) * middle[:, 2] + self.across - G * Z
        a -= m.drag / m.mass * x[3:6]
        q = product(q, rotation(h * omega + h * h / 2 * turn))
        q /= np.linalg.norm(q)
        p, v = x[:3] + h * x[3:6] + h * h / 2 * a, x[3:6] + h * a
        return np.concatenate([p, v, q, omega + h * turn])

    @staticmethod
    def away(x: Array, y: Array) -> Array:
        turn = log(product(inverse(y[6:10]), x[6:10]))
        return np.concatenate([x[:6] - y[:6], turn, x[10:] - y[10:]])

    def derivatives(self, x: Array, u: Array, m: Any, h: float) -> tuple[Array, Array]:
        turn, eye, d = self.turn(x[10:], u, m), np.eye(3), m.drag / m.mass
        half, whole = h / 2 * x[10:] + h * h / 8 * turn, h * x[10:] + h * h / 2 * turn
        middle = matrix(product(x[6:10], rotation(half)))
        spread, half_spread = (eye - hat(w) / 2 + hat(w) @ hat(w) / 6 for w in (whole, half))
        tilt = -h * (u.sum() / m.mass + self.lift) * middle @ hat(Z)
        by_thrust = mixing(m)[1:] / m.inertia_b[:, None]
        A, B = np.eye(12), np.zeros((12, 4))
        A[:3, 3:6], A[3:6, 3:6] = (h - h * h / 2 * d) * eye, (1.0 - h * d) * eye
        A[3:6, 6:9], A[3:6, 9:] = tilt @ matrix(rotation(half)).T, tilt @ half_spread * h / 2
        A[6:9, 6:9], A[6:9, 9:] = matrix(rotation(-whole)), h * spread
        B[3:6] = h / m.mass * middle[:, [2]] + tilt @ half_spread @ by_thrust * h * h / 8
        B[6:9], B[9:] = spread @ by_thrust * h * h / 2, h * by_thrust
        A[:3, 6:], B[:3] = h / 2 * A[3:6, 6:], h / 2 * B[3:6]
        return A, B

    def step(self, s: Any, x: Any, r: Any, k: Any, m: Any, last: Any, dt: float) -> Any:
        h, N, low, high = s.horizon / self.N, self.N, m.thrust_min, m.thrust_max
        if self.adaptation is None:
            self.adaptation = Adaptation(x, last)
        found = self.adaptation
        found.step((1.0, 1.0), (s.force_cutoff, s.torque_cutoff), x, m, last, dt)
        most = s.force_max / m.mass
        self.lift = np.clip(found.lift, -most, most)
        self.across = np.clip(found.across, -most, most)
        most = s.torque_max / m.inertia_b
        self.spin = np.clip(found.t, -most, most)
        self.plan(r, m, h)
        if self.x is None:
            self.x, self.u = list(self.x_r), [np.clip(u, low, high) for u in self.u_r[:N]]
        xy, z, yaw = [s.position_xy] * 2, [s.position_z], [s.yaw]
        Q = np.diag([*xy, *z, *[s.velocity] * 3, *[s.tilt] * 2, *yaw, *[s.rates] * 3])
        C = s.thrust * np.eye(4)
        V = s.last * Q
        g = V @ self.away(self.x[N], self.x_r[N])
        moves: list[tuple[Array, Array]] = []
        for n in range(N - 1, -1, -1):
            A, B = self.derivatives(self.x[n], self.u[n], m, h)
            H, F = C + B.T @ V @ B, B.T @ V @ A
            f = C @ (self.u[n] - self.u_r[n]) + B.T @ g
            held = (self.u[n] <= low) & (f > 0.0) | (self.u[n] >= high) & (f < 0.0)
            free = np.flatnonzero(~held)
            K, c = np.zeros((4, 12)), np.zeros(4)
            K[free] = -np.linalg.solve(H[np.ix_(free, free)], F[free])
            c[free] = -np.linalg.solve(H[np.ix_(free, free)], f[free])
            moves.insert(0, (K, c))
            g, V = A.T @ (g + V @ B @ c), A.T @ V @ (A + B @ K)
            V = 0.5 * (V + V.T)
            if n:
                V, g = V + Q, g + Q @ self.away(self.x[n], self.x_r[n])
        now = np.concatenate([x.position_w, x.velocity_w, x.quaternion_wb, x.angular_velocity_b])
        acting = np.linalg.solve(mixing(m), found.rotors.now(m))
        now = self.next(now, acting, m, m.motor_time_constant)
        flown = []
        for n in range(N):
            K, c = moves[n]
            self.u[n] = np.clip(self.u[n] + c + K @ self.away(now, self.x[n]), low, high)
            flown.append(now)
            now = self.next(now, self.u[n], m, h)
        self.x = [*flown, now]
        thrust, *torque = mixing(m) @ self.u[0]
        return allocated(thrust, np.array(torque), k, m)[0]


LAWS["nmpc"] = Nmpc
