// The onboard step by hand in C++17: filter, the 8, eqs. 4 and 5 with feed-forward, allocation.
#pragma once
#include <algorithm>
#include <cmath>

#include "records.hpp"
#include "vectors.hpp"

constexpr double kGravity = 9.81;

inline void predict(EstimatorMemory& m, const ImuSample& imu, const EstimationGains& g, double dt,
                    State& out) {
    Vec bias = load(m.gyroscope_bias_b), rate = load(imu.angular_velocity_b);
    Vec force = load(imu.specific_force_b), a_bias = load(m.accelerometer_bias_b);
    Vec filtered = load(m.filtered_rate_b), last = load(m.rate_b);
    Vec last_force = load(m.specific_force_b);
    if (!m.primed) {
        m.primed = 1;
        last = rate, last_force = force, filtered = rate - bias;
    }
    filtered = filtered + -std::expm1(-2.0 * M_PI * g.rate_low_pass * dt) * (rate - bias - filtered);
    if (m.initialized) {
        Quat q{m.pose[3], m.pose[4], m.pose[5], m.pose[6]};
        Vec omega = 0.5 * (rate + last) - bias, down{0, 0, -kGravity};
        Vec start = turn(q, last_force - a_bias) + down;
        double angle = 0.5 * dt * std::sqrt(dot(omega, omega));
        double s = 0.5 * dt * (angle > 1e-9 ? std::sin(angle) / angle : 1.0);
        q = q * Quat{std::cos(angle), s * omega.x, s * omega.y, s * omega.z};
        q = (1.0 + 0.5 * std::expm1(-2.0 * g.norm_penalty * dt) * (dot(q, q) - 1.0)) * q;
        Vec end = turn(q, force - a_bias) + down;
        Vec p = load(m.pose), v = load(m.velocity_w);
        store(p + dt * (v + dt / 6.0 * (2.0 * start + end)), m.pose);
        store(v + 0.5 * dt * (start + end), m.velocity_w);
        m.pose[3] = q.w, m.pose[4] = q.x, m.pose[5] = q.y, m.pose[6] = q.z;
    }
    m.stamp_ns = imu.stamp_ns;
    m.ring_stamp_ns[m.ring_next] = m.stamp_ns;
    std::copy(m.pose, m.pose + 7, m.ring_pose[m.ring_next]);
    m.ring_next = (m.ring_next + 1) & (kHistory - 1);
    m.ring_count = std::min<int64_t>(m.ring_count + 1, kHistory);
    store(rate, m.rate_b), store(force, m.specific_force_b), store(filtered, m.filtered_rate_b);
    std::copy(m.pose, m.pose + 3, out.position_w);
    std::copy(m.velocity_w, m.velocity_w + 3, out.velocity_w);
    std::copy(m.pose + 3, m.pose + 7, out.quaternion_wb);
    store(filtered, out.angular_velocity_b);
}

struct Derivatives {
    double v[5];
};

inline Derivatives ramped_phase(double t, double rate, double ramp, double total) {
    double end = total / rate + ramp;
    if (t <= 0.0) return {{0, 0, 0, 0, 0}};
    if (t >= end) return {{total, 0, 0, 0, 0}};
    bool rising = t < ramp;
    if (!rising && t <= end - ramp) return {{rate * (t - 0.5 * ramp), rate, 0, 0, 0}};
    double sign = rising ? 1.0 : -1.0, per = 1.0 / ramp, x = (rising ? t : end - t) * per;
    double x2 = x * x, x4 = x2 * x2, xy = x * (1.0 - x), bend = rate * per;
    double area = rate * ramp * x4 * x * (7.0 - 14.0 * x + 10.0 * x2 - 2.5 * x2 * x);
    return {{rising ? area : total - area, rate * x4 * (35.0 - 84.0 * x + 70.0 * x2 - 20.0 * x2 * x),
             sign * bend * 140.0 * xy * xy * xy, bend * per * 420.0 * xy * xy * (1.0 - 2.0 * x),
             sign * bend * per * per * 840.0 * xy * (1.0 - 5.0 * xy)}};
}

inline Derivatives circling(double s, double c, double a, double b, double d, double e) {
    double aa = a * a;
    return {{s, c * a, c * b - s * aa, c * (d - aa * a) - 3.0 * s * a * b,
             c * (e - 6.0 * aa * b) - s * (4.0 * a * d + 3.0 * b * b - aa * aa)}};
}

inline void figure_eight(const Eight& eight, double t, Reference& r) {
    auto [q, a, b, d, e] = ramped_phase(t, eight.rate, eight.ramp, eight.total).v;
    double s = std::sin(q), c = std::cos(q);
    Derivatives one = circling(s, c, a, b, d, e);
    Derivatives two = circling(2 * s * c, c * c - s * s, 2 * a, 2 * b, 2 * d, 2 * e);
    for (int i = 0; i < 3; ++i) {
        const Derivatives& f = i == 1 ? two : one;
        double k = eight.amplitude[i];
        r.position_w[i] = eight.center[i] + k * f.v[0];
        r.velocity_w[i] = k * f.v[1];
        r.acceleration_w[i] = k * f.v[2];
        r.jerk_w[i] = k * f.v[3];
        r.snap_w[i] = k * f.v[4];
    }
    r.yaw = eight.center[3] + eight.amplitude[3] * one.v[0];
    r.yaw_rate = eight.amplitude[3] * one.v[1];
    r.yaw_acceleration = eight.amplitude[3] * one.v[2];
}

struct Moving {
    Vec a, d, dd;  // a vector and its first two time derivatives
};

inline Moving unit(const Moving& m) {
    double k = 1.0 / std::sqrt(dot(m.a, m.a));
    Vec u = k * m.a;
    double n1 = dot(u, m.d);
    Vec u1 = k * (m.d - n1 * u);
    double n2 = dot(u1, m.d) + dot(u, m.dd);
    return {u, u1, k * (m.dd - 2.0 * n1 * u1 - n2 * u)};
}

inline Moving cross(const Moving& a, const Moving& b) {
    return {cross(a.a, b.a), cross(a.d, b.a) + cross(a.a, b.d),
            cross(a.dd, b.a) + cross(a.a, b.dd) + 2.0 * cross(a.d, b.d)};
}

inline void wind(double* integral, Vec error, double dt, double bound) {
    const double e[3] = {error.x, error.y, error.z};
    for (int i = 0; i < 3; ++i)
        if (std::isfinite(e[i])) integral[i] = std::clamp(integral[i] + e[i] * dt, -bound, bound);
}

inline double largest_share(double rest, double low, double high) {
    if (rest > high) return rest < INFINITY ? high / rest : 0.0;
    if (rest < low) return rest > -INFINITY ? low / rest : 0.0;
    return std::isnan(rest) ? 0.0 : 1.0;
}

// Nominal rates only and no disturbance observer (the project's defaults).
inline void control(ControlMemory& m, const State& state, const Reference& r, const ControlGains& g,
                    const Model& model, bool airborne, double dt, Actuators& out) {
    const double mass = model.mass, weight = mass * kGravity;
    const double* quat = state.quaternion_wb;
    Axes R = axes_of({quat[0], quat[1], quat[2], quat[3]});
    Vec omega = load(state.angular_velocity_b);
    const double by_mass = 1.0 / mass, drag = model.drag * by_mass;
    Vec reference_acceleration = load(r.acceleration_w), reference_jerk = load(r.jerk_w);
    Vec across = load(m.disturbing_force_w) - m.disturbing_lift * R.z;
    Vec acceleration = reference_acceleration + drag * load(r.velocity_w) - by_mass * across;
    Vec jerk = reference_jerk + drag * reference_acceleration - by_mass * load(m.disturbing_force_rate_w);
    Vec snap = load(r.snap_w) + drag * reference_jerk - by_mass * load(m.disturbing_force_curve_w);
    Vec e_p = load(r.position_w) - load(state.position_w);
    Vec e_v = load(r.velocity_w) - load(state.velocity_w);
    Vec f = load(g.kp) * e_p + load(g.kv) * e_v + load(g.ki) * load(m.position_integral_w);
    f = mass * (acceleration + f + Vec{0, 0, kGravity});
    bool limited = false;
    if (f.z < 0.3 * weight) f.z = 0.3 * weight, limited = true;
    double sideways = std::sqrt(f.x * f.x + f.y * f.y), allowed = f.z * g.tan_tilt_max;
    if (sideways > allowed) f.x *= allowed / sideways, f.y *= allowed / sideways, limited = true;
    m.tilt_limited = limited;

    Vec omega_d{0, 0, 0}, omega_dot_d{0, 0, 0};
    Axes D;
    auto& last = m.desired_attitude;
    double square = dot(f, f);
    if (square >= 0.01 * weight * weight && std::isfinite(square + r.yaw)) {
        double s = std::sin(r.yaw), c = std::cos(r.yaw), w2 = r.yaw_rate * r.yaw_rate;
        Vec z = 1.0 / std::sqrt(square) * f, x = cross(Vec{-s, c, 0}, z);
        x = 1.0 / std::sqrt(dot(x, x)) * x;
        D = {x, cross(z, x), z};
        double columns[3][3];
        store(D.x, columns[0]), store(D.y, columns[1]), store(D.z, columns[2]);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) last[i][j] = columns[j][i];
        Moving n{mass * (acceleration + Vec{0, 0, kGravity}), mass * jerk,
                 mass * snap};
        if (n.a.z >= 0.1 * weight) {
            Moving y_c{{-s, c, 0},
                       {-c * r.yaw_rate, -s * r.yaw_rate, 0},
                       {-c * r.yaw_acceleration + s * w2, -s * r.yaw_acceleration - c * w2, 0}};
            Moving zn = unit(n), xn = unit(cross(y_c, zn)), yn = cross(zn, xn);
            omega_d = {dot(zn.a, yn.d), dot(xn.a, zn.d), dot(yn.a, xn.d)};
            omega_dot_d = 0.5 * Vec{dot(zn.a, yn.dd) - dot(yn.a, zn.dd),
                                    dot(xn.a, zn.dd) - dot(zn.a, xn.dd),
                                    dot(yn.a, xn.dd) - dot(xn.a, yn.dd)};
        }
    } else {
        D = {{last[0][0], last[1][0], last[2][0]},
             {last[0][1], last[1][1], last[2][1]},
             {last[0][2], last[1][2], last[2][2]}};
    }

    double thrust = dot(f, R.z) - m.disturbing_lift;
    thrust = thrust < 0.0 ? 0.0 : thrust;
    Vec e_R = 0.5 * Vec{dot(R.z, D.y) - dot(R.y, D.z), dot(R.x, D.z) - dot(R.z, D.x),
                        dot(R.y, D.x) - dot(R.x, D.y)};
    Vec J = load(model.inertia_b);
    Vec wanted = to_body(R, to_world(D, omega_d));
    Vec feedback = load(g.kr) * e_R + load(g.kf) * load(m.attitude_integral_b) +
                   load(g.kw) * (wanted - omega);
    Vec forward = to_body(R, to_world(D, omega_dot_d)) - cross(omega, wanted);
    Vec torque = J * (feedback + forward) + cross(omega, J * omega);
    torque = torque - load(m.disturbing_torque_b);
    torque.z = std::clamp(torque.z, -g.yaw_torque_max, g.yaw_torque_max);

    double low = model.thrust_min, high = model.thrust_max;
    double f_g = std::clamp(0.25 * weight, low, high), lift = 0.25 * thrust - f_g;
    double roll = 0.5 * torque.x / model.arm, pitch = 0.5 * torque.y / model.arm;
    double yaw = 0.25 * torque.z / model.torque_ratio, scaling = 1.0;
    double rest[4] = {lift - pitch + yaw, lift + roll - yaw, lift + pitch + yaw, lift - roll - yaw};
    for (double one : rest) scaling = std::min(scaling, largest_share(one, low - f_g, high - f_g));
    double* t = out.thrusts;
    for (int i = 0; i < 4; ++i)
        t[i] = scaling > 0.0 ? std::clamp(f_g + scaling * rest[i], low, high) : f_g;
    if (airborne && scaling == 1.0 && !limited) {
        wind(m.position_integral_w, e_p, dt, g.position_integral_max);
        wind(m.attitude_integral_b, e_R, dt, g.attitude_integral_max);
    }
    out.wrench[0] = t[0] + t[1] + t[2] + t[3];
    out.wrench[1] = model.arm * (t[1] - t[3]);
    out.wrench[2] = model.arm * (t[2] - t[0]);
    out.wrench[3] = model.torque_ratio * (t[0] - t[1] + t[2] - t[3]);
    for (int i = 0; i < 4; ++i)
        out.motor_references[i] =
            std::max(0.0, std::sqrt(std::max(0.0, t[i])) / model.motor_slope - model.motor_offset);
    out.scaling = scaling;
}

inline void steer(Onboard& v, const Settings& s, double t, bool airborne, double dt) {
    figure_eight(s.eight, t, v.reference);
    control(v.controller, v.state, v.reference, s.control, s.model, airborne, dt, v.actuators);
}
