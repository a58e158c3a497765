/* The geometric law of the paper, eqs. 4 and 5, with its limits. The same arithmetic as
 * control/geometric_law.py, which explains it. */
#include <stddef.h>
#include <string.h>

#include "model.h"
#include "vectors.h"

#define DIRECTION_MIN 0.1 /* share of the weight below which a force has no usable direction */
#define LIFT_MIN 0.3      /* smallest upward part of the desired force, share of the weight */

/* The memory: integrals (m s; rad s) and the columns of the last desired attitude. */
enum { INTEGRAL_W = COUNT, INTEGRAL_B = COUNT + 3, DESIRED = COUNT + 6 };

/* A vector with its first and second time derivative. */
typedef struct {
    Vector a, dot, ddot;
} Moving;

static Vector gains(const double v[], int xy, int z) { return (Vector){v[xy], v[xy], v[z]}; }

/* ---- desired force */
static int limit_force(Vector *f, double weight, double tan_tilt_max) {
    int limited = 0;
    if (f->z < LIFT_MIN * weight) {
        f->z = LIFT_MIN * weight;
        limited = 1;
    }
    const double sideways = sqrt(f->x * f->x + f->y * f->y), allowed = f->z * tan_tilt_max;
    if (sideways > allowed) {
        f->x *= allowed / sideways;
        f->y *= allowed / sideways;
        limited = 1;
    }
    return limited;
}

/* f_d' and f_d'' along the model. */
static void force_rates(const double v[], Vector e_p, Vector e_v, Moving nominal, Axes axes,
                        Vector omega_b, Moving *force) {
    const double mass = v[MASS];
    const Vector kp = gains(v, CONTROL_POSITION_KP_XY, CONTROL_POSITION_KP_Z);
    const Vector kv = gains(v, CONTROL_POSITION_KV_XY, CONTROL_POSITION_KV_Z);
    const Vector ki = gains(v, CONTROL_POSITION_KI_XY, CONTROL_POSITION_KI_Z);
    const Vector z_dot = subtract(scale(omega_b.y, axes.x), scale(omega_b.x, axes.y));
    const double thrust = dot(force->a, axes.z);
    Vector e_a = subtract(nominal.a, scale(thrust / mass, axes.z));
    e_a.z += GRAVITY;
    Vector rate = add(add(times(kp, e_v), times(ki, e_p)), times(kv, e_a));
    force->dot = scale(mass, add(nominal.dot, rate));
    const double thrust_dot = dot(force->dot, axes.z) + dot(force->a, z_dot);
    const Vector jerk = scale(1.0 / mass, along(scale(thrust_dot, axes.z), thrust, z_dot));
    rate = add(add(times(kp, e_a), times(ki, e_v)), times(kv, subtract(nominal.dot, jerk)));
    force->ddot = scale(mass, add(nominal.ddot, rate));
}

/* ---- desired attitude */
static Vector unit(Vector a) { return scale(1.0 / sqrt(dot(a, a)), a); }

static Moving unit_moving(Moving a) {
    const double k = 1.0 / sqrt(dot(a.a, a.a));
    const Vector u = scale(k, a.a);
    const double n_dot = dot(u, a.dot);
    const Vector u_dot = scale(k, along(a.dot, -n_dot, u));
    const double n_ddot = dot(u_dot, a.dot) + dot(u, a.ddot);
    const Vector u_ddot = scale(k, along(along(a.ddot, -2.0 * n_dot, u_dot), -n_ddot, u));
    return (Moving){u, u_dot, u_ddot};
}

static Moving cross_moving(Moving a, Moving b) {
    const Vector first = add(cross(a.dot, b.a), cross(a.a, b.dot));
    const Vector second = add(cross(a.ddot, b.a), cross(a.a, b.ddot));
    return (Moving){cross(a.a, b.a), first, along(second, 2.0, cross(a.dot, b.dot))};
}

static Axes axes_of_force(Vector force_w, double yaw) {
    const Vector z = unit(force_w);
    const Vector x = unit(cross((Vector){-sin(yaw), cos(yaw), 0.0}, z));
    return (Axes){x, cross(z, x), z};
}

/* Angular velocity and acceleration of the attitude of a force, about its own axes. */
static void rates_of_force(Moving force, const double v[], Vector *omega, Vector *omega_dot) {
    const double s = sin(v[REFERENCE_YAW]), c = cos(v[REFERENCE_YAW]);
    const double rate = v[REFERENCE_YAW_RATE], bend = v[REFERENCE_YAW_ACCELERATION];
    const double square = rate * rate;
    const Moving y_c = {{-s, c, 0.0},
                        {-c * rate, -s * rate, 0.0},
                        {-c * bend + s * square, -s * bend - c * square, 0.0}};
    const Moving z = unit_moving(force), x = unit_moving(cross_moving(y_c, z));
    const Moving y = cross_moving(z, x);
    *omega = (Vector){dot(z.a, y.dot), dot(x.a, z.dot), dot(y.a, x.dot)};
    *omega_dot = (Vector){0.5 * (dot(z.a, y.ddot) - dot(y.a, z.ddot)),
                          0.5 * (dot(x.a, z.ddot) - dot(z.a, x.ddot)),
                          0.5 * (dot(y.a, x.ddot) - dot(x.a, y.ddot))};
}

/* ---- thrusts */
static double largest_share(double rest, double low, double high) {
    if (isnan(rest)) return 0.0;
    if (rest > high) return isinf(rest) ? 0.0 : high / rest;
    if (rest < low) return isinf(rest) ? 0.0 : low / rest;
    return 1.0;
}

/* Scales the torques and what is not gravity until no motor is at its limit; returns by what. */
static double allocate(const double v[], double thrust, Vector torque, double f[4]) {
    const double slope = v[MODEL_MOTOR_SLOPE], offset = v[MODEL_MOTOR_OFFSET];
    const double low = thrust_of(v[MODEL_MOTOR_REFERENCE_MIN], slope, offset);
    const double high = thrust_of(v[MODEL_MOTOR_REFERENCE_MAX], slope, offset);
    const double g = clamp(0.25 * v[MASS] * GRAVITY, low, high);
    const double a = 0.25 * thrust, roll = 0.5 * torque.x / v[MODEL_ARM];
    const double pitch = 0.5 * torque.y / v[MODEL_ARM];
    const double yaw = 0.25 * torque.z / v[MODEL_TORQUE_RATIO];
    f[0] = a - pitch + yaw, f[1] = a + roll - yaw, f[2] = a + pitch + yaw, f[3] = a - roll - yaw;
    double s = 1.0;
    for (int i = 0; i < 4; i++) {
        const double share = largest_share(f[i] - g, low - g, high - g);
        if (share < s) s = share;
    }
    for (int i = 0; i < 4; i++) f[i] = s > 0.0 ? clamp(g + s * (f[i] - g), low, high) : g;
    return s;
}

static void wind(double integral[], Vector error, double dt, double bound) {
    const double e[3] = {error.x, error.y, error.z};
    for (int i = 0; i < 3; i++)
        if (isfinite(e[i])) integral[i] = clamp(integral[i] + e[i] * dt, -bound, bound);
}

/* ---- the law */
static void forget(double v[]) {
    memset(v + COUNT, 0, MEMORY * sizeof *v);
    for (int i = 0; i < 3; i++) v[DESIRED + 4 * i] = 1.0;
}

static void compute(double v[], double dt) {
    if (v[RESET] > 0.5) forget(v);
    const double mass = v[MASS], weight = mass * GRAVITY, drag = v[MODEL_DRAG] * (1.0 / mass);
    const double *q = v + QUATERNION_WB;
    const Axes axes = axes_of((Quaternion){q[0], q[1], q[2], q[3]});
    const Vector omega_b = load(v + ANGULAR_VELOCITY_B), J = load(v + INERTIA_B);
    const Vector velocity_w = load(v + REFERENCE_VELOCITY_W);
    const Vector acceleration_w = load(v + REFERENCE_ACCELERATION_W);
    const Vector jerk_w = load(v + REFERENCE_JERK_W);
    const Moving nominal = {along(acceleration_w, drag, velocity_w),
                            along(jerk_w, drag, acceleration_w),
                            along(load(v + REFERENCE_SNAP_W), drag, jerk_w)};
    const Vector drag_b = scale(-v[MODEL_DRAG], to_body(axes, velocity_w));
    const Vector e_p = subtract(load(v + REFERENCE_POSITION_W), load(v + POSITION_W));
    const Vector e_v = subtract(velocity_w, load(v + VELOCITY_W));

    /* Eq. 4. */
    const Vector kp = gains(v, CONTROL_POSITION_KP_XY, CONTROL_POSITION_KP_Z);
    const Vector kv = gains(v, CONTROL_POSITION_KV_XY, CONTROL_POSITION_KV_Z);
    const Vector ki = gains(v, CONTROL_POSITION_KI_XY, CONTROL_POSITION_KI_Z);
    const Vector back_w = add(add(times(kp, e_p), times(kv, e_v)), times(ki, load(v + INTEGRAL_W)));
    const Vector wanted_w = add(nominal.a, back_w);
    Vector force_w = {mass * wanted_w.x, mass * wanted_w.y, mass * (wanted_w.z + GRAVITY)};
    const int limited = limit_force(&force_w, weight, tan(v[CONTROL_LIMITS_TILT_MAX] * PI / 180.0));

    /* The desired attitude and its rates; a force without direction keeps the last one, at rest. */
    Axes desired = {load(v + DESIRED), load(v + DESIRED + 3), load(v + DESIRED + 6)};
    Vector omega_d = {0.0, 0.0, 0.0}, omega_dot_d = {0.0, 0.0, 0.0};
    const double square = dot(force_w, force_w), least = DIRECTION_MIN * weight;
    if (square >= least * least && isfinite(square + v[REFERENCE_YAW])) {
        desired = axes_of_force(force_w, v[REFERENCE_YAW]);
        store(desired.x, v + DESIRED);
        store(desired.y, v + DESIRED + 3);
        store(desired.z, v + DESIRED + 6);
        Moving force = {.a = force_w};
        if (v[CONTROL_ATTITUDE_RATES] > 1.5) { /* exact */
            force_rates(v, e_p, e_v, nominal, axes, omega_b, &force);
        } else {
            force.a = scale(mass, (Vector){nominal.a.x, nominal.a.y, nominal.a.z + GRAVITY});
            force.dot = scale(mass, nominal.dot), force.ddot = scale(mass, nominal.ddot);
        }
        if (force.a.z >= least) rates_of_force(force, v, &omega_d, &omega_dot_d);
    }

    /* Eq. 5. */
    double thrust = dot(force_w, axes.z);
    thrust = thrust < 0.0 ? 0.0 : thrust;
    const Vector e_R = {0.5 * (dot(axes.z, desired.y) - dot(axes.y, desired.z)),
                        0.5 * (dot(axes.x, desired.z) - dot(axes.z, desired.x)),
                        0.5 * (dot(axes.y, desired.x) - dot(axes.x, desired.y))};
    const Vector kr = gains(v, CONTROL_ATTITUDE_KR_XY, CONTROL_ATTITUDE_KR_Z);
    const Vector kw = gains(v, CONTROL_ATTITUDE_KW_XY, CONTROL_ATTITUDE_KW_Z);
    const Vector kf = gains(v, CONTROL_ATTITUDE_KI_XY, CONTROL_ATTITUDE_KI_Z);
    const Vector wanted = to_body(axes, to_world(desired, omega_d));
    const Vector wanted_dot = to_body(axes, to_world(desired, omega_dot_d));
    Vector turn = add(times(kr, e_R), times(kf, load(v + INTEGRAL_B)));
    turn = add(turn, times(kw, subtract(wanted, omega_b)));
    turn = add(turn, subtract(wanted_dot, cross(omega_b, wanted)));
    Vector torque = add(times(J, turn), cross(omega_b, times(J, omega_b)));
    torque = subtract(torque, drag_torque(v[MODEL_DRAG_LEVER], drag_b));
    const double bound = v[CONTROL_LIMITS_YAW_TORQUE_MAX];
    torque.z = clamp(torque.z, -bound, bound);

    double f[4];
    const double scaling = allocate(v, thrust, torque, f);
    if (v[FLYING] > 0.5 && scaling == 1.0 && !limited) {
        wind(v + INTEGRAL_W, e_p, dt, v[CONTROL_LIMITS_POSITION_INTEGRAL_MAX]);
        wind(v + INTEGRAL_B, e_R, dt, v[CONTROL_LIMITS_ATTITUDE_INTEGRAL_MAX]);
    }
    v[THRUST] = f[0] + f[1] + f[2] + f[3];
    v[TORQUE_B] = v[MODEL_ARM] * (f[1] - f[3]);
    v[TORQUE_B + 1] = v[MODEL_ARM] * (f[2] - f[0]);
    v[TORQUE_B + 2] = v[MODEL_TORQUE_RATIO] * (f[0] - f[1] + f[2] - f[3]);
    for (int i = 0; i < 4; i++) {
        const double reference = sqrt(f[i]) / v[MODEL_MOTOR_SLOPE] - v[MODEL_MOTOR_OFFSET];
        v[MOTOR_REFERENCES + i] = reference > 0.0 ? reference : 0.0;
    }
}

void model_begin(double v[]) {
    forget(v);
    compute(v, 0.0);
}

const char *model_step(double v[], double h) {
    compute(v, h);
    return NULL;
}
