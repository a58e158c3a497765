/* An estimator for tests of FMUs: the IMU integrated, and a part of the way to each pose. */
#include <stddef.h>
#include <string.h>

#include "model.h"
#include "vectors.h"

static void turn(double q[], Vector by) {
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    q[0] -= x * by.x + y * by.y + z * by.z;
    q[1] += w * by.x + y * by.z - z * by.y;
    q[2] += w * by.y + z * by.x - x * by.z;
    q[3] += w * by.z + x * by.y - y * by.x;
}

static void move(double a[], double gain, const double error[], int n) {
    for (int i = 0; i < n; i++) a[i] += gain * error[i];
}

void model_begin(double v[]) { v[QUATERNION_WB] = 1.0; }

const char *model_step(double v[], double h) {
    double *p = v + POSITION_W, *u = v + VELOCITY_W, *q = v + QUATERNION_WB, e[4];
    if (v[RESET] > 0.5) {
        memcpy(p, v + START_POSITION_W, 3 * sizeof *p);
        memcpy(u, v + START_VELOCITY_W, 3 * sizeof *u);
        memcpy(q, v + START_QUATERNION_WB, 4 * sizeof *q);
    }
    turn(q, scale(0.5 * h, load(v + ANGULAR_VELOCITY_B)));
    const Quaternion now = {q[0], q[1], q[2], q[3]};
    const Vector force_w = to_world(axes_of(now), load(v + SPECIFIC_FORCE_B));
    const double a[3] = {force_w.x, force_w.y, force_w.z - GRAVITY};
    move(p, h, u, 3);
    move(u, h, a, 3);
    if (v[POSE_COUNT] > 0.5) {
        for (int i = 0; i < 3; i++) e[i] = v[POSE_POSITION_W + i] - p[i];
        move(p, v[GAIN], e, 3);
        move(u, 5.0 * v[GAIN], e, 3);
        double same = 0.0;
        for (int i = 0; i < 4; i++) same += q[i] * v[POSE_QUATERNION_WB + i];
        for (int i = 0; i < 4; i++)
            e[i] = (same < 0.0 ? -1.0 : 1.0) * v[POSE_QUATERNION_WB + i] - q[i];
        move(q, 0.5 * v[GAIN], e, 4);
    }
    double length = 0.0;
    for (int i = 0; i < 4; i++) length += q[i] * q[i];
    for (int i = 0; i < 4; i++) q[i] /= sqrt(length);
    return NULL;
}
