#pragma once
#include <cmath>

struct Vec {
    double x, y, z;
};

inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec operator*(Vec a, Vec b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec load(const double* a) { return {a[0], a[1], a[2]}; }
inline void store(Vec v, double* a) { a[0] = v.x, a[1] = v.y, a[2] = v.z; }

struct Quat {
    double w, x, y, z;
};

inline Quat operator+(Quat a, Quat b) { return {a.w + b.w, a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Quat operator*(double s, Quat a) { return {s * a.w, s * a.x, s * a.y, s * a.z}; }
inline Quat operator*(Quat p, Quat q) {
    return {p.w * q.w - p.x * q.x - p.y * q.y - p.z * q.z,
            p.w * q.x + q.w * p.x + p.y * q.z - p.z * q.y,
            p.w * q.y + q.w * p.y + p.z * q.x - p.x * q.z,
            p.w * q.z + q.w * p.z + p.x * q.y - p.y * q.x};
}
inline double dot(Quat a, Quat b) { return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z; }

// Columns of R_wb.
struct Axes {
    Vec x, y, z;
};

inline Axes axes_of(Quat q) {
    auto [w, x, y, z] = q;
    return {{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
            {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
            {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}};
}
inline Vec to_world(const Axes& R, Vec v) { return v.x * R.x + v.y * R.y + v.z * R.z; }
inline Vec to_body(const Axes& R, Vec v) { return {dot(R.x, v), dot(R.y, v), dot(R.z, v)}; }
inline Vec turn(Quat q, Vec v) {
    Vec u{q.x, q.y, q.z};
    Vec t = 2.0 * cross(u, v);
    return v + q.w * t + cross(u, t);
}
