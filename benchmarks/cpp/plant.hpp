// Rotors and rigid body by hand in C++17: the classical Runge-Kutta scheme, no ground.
#pragma once
#include <cmath>

#include "onboard.hpp"

struct Motion {
    Vec p, v;
    Quat q;
    Vec w;
};

inline Vec lean(Quat q) { return {q.x * q.z + q.w * q.y, q.y * q.z - q.w * q.x, q.x * q.x + q.y * q.y}; }

inline Quat turning(Quat q, Vec w) {
    return {-q.x * w.x - q.y * w.y - q.z * w.z, q.w * w.x + q.y * w.z - q.z * w.y,
            q.w * w.y + q.z * w.x - q.x * w.z, q.w * w.z + q.x * w.y - q.y * w.x};
}

inline Vec spin(Vec w, Vec turn, Vec ratios) {
    return turn - ratios * Vec{w.y * w.z, w.z * w.x, w.x * w.y};
}

// Thrust over mass and torque over inertia at one moment.
struct Drive {
    double lift;
    Vec turn;
};

inline Vec acceleration(Quat q, double lift, Vec push, double damping, Vec v) {
    Vec l = 2.0 * lift * lean(q);
    return push - damping * v + Vec{l.x, l.y, lift - kGravity - l.z};
}

inline Motion rk4(const Motion& m, const Drive& d1, const Drive& d2, const Drive& d4, Vec push,
                  double damping, Vec ratios, double dt) {
    double half = 0.5 * dt, sixth = dt / 6.0;
    Vec s1 = spin(m.w, d1.turn, ratios), w2 = m.w + half * s1;
    Vec s2 = spin(w2, d2.turn, ratios), w3 = m.w + half * s2;
    Vec s3 = spin(w3, d2.turn, ratios), w4 = m.w + dt * s3;
    Vec s4 = spin(w4, d4.turn, ratios);
    Quat t1 = turning(m.q, m.w), q2 = m.q + 0.5 * half * t1;
    Quat t2 = turning(q2, w2), q3 = m.q + 0.5 * half * t2;
    Quat t3 = turning(q3, w3), q4 = m.q + half * t3;
    Quat t4 = turning(q4, w4), q = m.q + 0.5 * sixth * (t1 + t4 + 2.0 * (t2 + t3));
    Vec a1 = acceleration(m.q, d1.lift, push, damping, m.v), v2 = m.v + half * a1;
    Vec a2 = acceleration(q2, d2.lift, push, damping, v2), v3 = m.v + half * a2;
    Vec a3 = acceleration(q3, d2.lift, push, damping, v3), v4 = m.v + dt * a3;
    Vec a4 = acceleration(q4, d4.lift, push, damping, v4);
    return {m.p + sixth * (m.v + v4 + 2.0 * (v2 + v3)), m.v + sixth * (a1 + a4 + 2.0 * (a2 + a3)),
            1.0 / std::sqrt(dot(q, q)) * q, m.w + sixth * (s1 + s4 + 2.0 * (s2 + s3))};
}

inline double rotor(double speed, const Model& m) {
    double root = m.motor_slope * (speed + m.motor_offset);
    return speed > 1.0 && root > 0.0 ? root * root : 0.0;
}

inline void move(Plant& p, const double* target, int steps, double dt, double share) {
    const Model& m = p.model;
    double by_mass = 1.0 / m.mass, e = p.thrust_efficiency * p.battery_share * p.air_share;
    Vec J = load(m.inertia_b), inverse{1 / J.x, 1 / J.y, 1 / J.z};
    Vec pull = load(p.disturbance_w) + p.drag * load(p.air_w);
    Vec ratios = Vec{J.z - J.y, J.x - J.z, J.y - J.x} * inverse;
    Motion now{load(p.x), load(p.x + 3), {p.x[6], p.x[7], p.x[8], p.x[9]}, load(p.x + 10)};
    double s[4] = {p.rotor_speeds[0], p.rotor_speeds[1], p.rotor_speeds[2], p.rotor_speeds[3]};
    auto driven = [&](double so_far) {
        double f[4];
        for (int i = 0; i < 4; ++i)
            f[i] = e * p.motor_gain[i] * rotor(s[i] + so_far * (target[i] - s[i]), m);
        Vec torque{m.arm * (f[1] - f[3]), m.arm * (f[2] - f[0]),
                   m.torque_ratio * (f[0] - f[1] + f[2] - f[3])};
        return Drive{by_mass * (f[0] + f[1] + f[2] + f[3]), torque * inverse};
    };
    double half_share = share / (1.0 + std::sqrt(1.0 - share));
    Drive start = driven(0.0);
    for (int k = 0; k < steps; ++k) {
        Drive middle = driven(half_share), end = driven(share);
        for (int i = 0; i < 4; ++i) s[i] += share * (target[i] - s[i]);
        now = rk4(now, start, middle, end, by_mass * pull, by_mass * p.drag, ratios, dt);
        start = end;
    }
    store(now.p, p.x), store(now.v, p.x + 3), store(now.w, p.x + 10);
    p.x[6] = now.q.w, p.x[7] = now.q.x, p.x[8] = now.q.y, p.x[9] = now.q.z;
    for (int i = 0; i < 4; ++i) p.rotor_speeds[i] = s[i];
    Vec felt = by_mass * to_body(axes_of(now.q), pull - p.drag * now.v);
    felt.z += start.lift;
    store(felt, p.specific_force_b);
}
