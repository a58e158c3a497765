/* Vectors, quaternions (w, x, y, z; body to world) and the columns of their matrices. */
#ifndef VECTORS_H
#define VECTORS_H

#include <math.h>

#define PI 3.14159265358979323846

typedef struct { double x, y, z; } Vector;
typedef struct { double w, x, y, z; } Quaternion;
typedef struct { Vector x, y, z; } Axes;

static inline Vector load(const double a[]) { return (Vector){a[0], a[1], a[2]}; }
static inline void store(Vector a, double out[]) { out[0] = a.x, out[1] = a.y, out[2] = a.z; }

static inline Vector add(Vector a, Vector b) {
    return (Vector){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline Vector subtract(Vector a, Vector b) {
    return (Vector){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline Vector scale(double s, Vector a) { return (Vector){s * a.x, s * a.y, s * a.z}; }
static inline Vector times(Vector a, Vector b) {
    return (Vector){a.x * b.x, a.y * b.y, a.z * b.z};
}
/* a + s b. */
static inline Vector along(Vector a, double s, Vector b) {
    return (Vector){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline Vector cross(Vector a, Vector b) {
    return (Vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double clamp(double value, double low, double high) {
    value = value > low ? value : low;
    return value < high ? value : high;
}
static inline Vector to_world(Axes R, Vector v_b) {
    return along(along(scale(v_b.x, R.x), v_b.y, R.y), v_b.z, R.z);
}
static inline Vector to_body(Axes R, Vector v_w) {
    return (Vector){dot(R.x, v_w), dot(R.y, v_w), dot(R.z, v_w)};
}
static inline Axes axes_of(Quaternion q) {
    const double w = q.w, x = q.x, y = q.y, z = q.z;
    return (Axes){
        {1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)},
        {2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)},
        {2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)}};
}
/* The torque of a drag that acts `lever` over the centre of mass. */
static inline Vector drag_torque(double lever, Vector force_b) {
    return (Vector){-lever * force_b.y, lever * force_b.x, 0.0};
}
/* N of a motor reference or rotor speed (counts). */
static inline double thrust_of(double reference, double slope, double offset) {
    const double root = slope * (reference + offset);
    return root > 0.0 ? root * root : 0.0;
}

#endif
