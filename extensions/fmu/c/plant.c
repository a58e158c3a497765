/* The simulated vehicle: rotors with lag, rigid body by the classical Runge-Kutta scheme, drag,
 * ground, battery. The same arithmetic as vehicle/simulator/plant.py, which explains it. */
#include <stddef.h>

#include "model.h"
#include "vectors.h"

#define FOOT 0.15          /* m, from the body's z axis to a foot */
#define FOOT_SHARE 0.6     /* of a shorter arm */
#define CONTACT_HEIGHT 0.5 /* m, above it no foot can touch the ground */
#define SLIP_DAMPING 100.0 /* N s/m a foot, below the Coulomb limit */
#define SLIP_DAMPING_SHARE 80.0 /* 1/s, of a lighter vehicle's mass */
#define SUBSTEP 0.001      /* s, the longest integration step */
#define STOPPED 1.0        /* counts at and below which a rotor gives nothing */
#define ROTOR_RADIUS 0.127 /* m */
#define ROTOR_HEIGHT 0.15  /* m, over the body's origin */
#define CELLS 4
#define AVIONICS_POWER 8.0 /* W */

enum { CHARGE = COUNT /* A s left, the only memory that is no output */ };

typedef struct {
    Vector p, v; /* m, m/s, world axes */
    Quaternion q;
    Vector w; /* rad/s, body axes */
} Motion;

/* Thrust over mass (m/s^2) and torque over inertia (rad/s^2). */
typedef struct {
    double lift;
    Vector turn;
} Drive;

typedef struct {
    const double *v;
    double mass, share; /* kg; of the thrust, all gains but each motor's */
    double gain[4];
    Vector J, inverse, air_w, force_w;
} Plant;

/* ---- rotors and air */
static double rotor_thrust(const double v[], double speed) {
    return speed > STOPPED ? thrust_of(speed, v[MOTOR_SLOPE], v[MOTOR_OFFSET]) : 0.0;
}

static Drive driven(const Plant *p, const double speeds[4]) {
    const double *v = p->v, e = p->share, arm = v[ARM];
    double f[4];
    for (int i = 0; i < 4; i++) f[i] = p->gain[i] * rotor_thrust(v, speeds[i]);
    const Vector torque = {e * (arm * (f[1] - f[3])), e * (arm * (f[2] - f[0])),
                           e * (v[TORQUE_RATIO] * (f[0] - f[1] + f[2] - f[3]))};
    return (Drive){e * (1.0 / p->mass) * (f[0] + f[1] + f[2] + f[3]), times(torque, p->inverse)};
}

static Vector air_speed_b(const Plant *p, const Motion *m) {
    return to_body(axes_of(m->q), along(m->v, -1.0, p->air_w));
}

static Vector rotor_drag(const Plant *p, const Motion *m) {
    const Vector air = air_speed_b(p, m);
    return (Vector){-p->v[ROTOR_DRAG_X] * air.x, -p->v[ROTOR_DRAG_Y] * air.y, 0.0};
}

static double inflow_gain(const Plant *p, const Motion *m) {
    const double loss = p->v[INFLOW_LOSS];
    return loss > 0.0 ? clamp(1.0 - loss * air_speed_b(p, m).z, 0.5, 1.5) : 1.0;
}

static double ground_gain(double share, double height) {
    if (share <= 0.0 || height > 1.0) return 1.0;
    const double z = height + ROTOR_HEIGHT;
    const double ratio = ROTOR_RADIUS / (4.0 * (z > ROTOR_RADIUS ? z : ROTOR_RADIUS));
    return 1.0 / (1.0 - share * ratio * ratio);
}

/* ---- ground */
static Vector touch(const Plant *p, const Motion *m, Axes axes, Vector arm_b, double height) {
    const double *v = p->v;
    const double rest_depth = p->mass * GRAVITY / v[GROUND_STIFFNESS];
    const double depth = rest_depth - (m->p.z + height);
    if (depth <= 0.0) return (Vector){0.0, 0.0, 0.0};
    const Vector foot_w = add(m->v, to_world(axes, cross(m->w, arm_b)));
    const double normal =
        v[GROUND_STIFFNESS] / 4.0 * depth - v[GROUND_DAMPING] / 4.0 * foot_w.z;
    if (normal <= 0.0) return (Vector){0.0, 0.0, 0.0};
    const double slip = sqrt(foot_w.x * foot_w.x + foot_w.y * foot_w.y);
    const double most = v[GROUND_FRICTION] * normal;
    const double held = fmin(SLIP_DAMPING, SLIP_DAMPING_SHARE * p->mass);
    const double grip = held * slip > most ? most / slip : held;
    return (Vector){-grip * foot_w.x, -grip * foot_w.y, normal};
}

/* The ground's force in world axes, and its torque about body axes. */
static Vector stand(const Plant *p, const Motion *m, Vector *torque_b) {
    const Axes axes = axes_of(m->q);
    Vector force_w = {0.0, 0.0, 0.0};
    *torque_b = force_w;
    const double foot = fmin(FOOT, FOOT_SHARE * p->v[ARM]);
    for (int side = 0; side < 2; side++) {
        const double lever = side ? -foot : foot;
        for (int k = 0; k < 2; k++) {
            const Vector arm_b = {k ? 0.0 : lever, k ? lever : 0.0, 0.0};
            const double height = lever * (k ? axes.y.z : axes.x.z);
            const Vector foot_w = touch(p, m, axes, arm_b, height);
            force_w = add(force_w, foot_w);
            *torque_b = add(*torque_b, cross(arm_b, to_body(axes, foot_w)));
        }
    }
    return force_w;
}

/* ---- rigid body */
static Quaternion ahead(Quaternion q, double s, Quaternion d) {
    return (Quaternion){q.w + s * d.w, q.x + s * d.x, q.y + s * d.y, q.z + s * d.z};
}

static Quaternion turning(Quaternion q, Vector w) {
    return (Quaternion){-q.x * w.x - q.y * w.y - q.z * w.z, q.w * w.x + q.y * w.z - q.z * w.y,
                        q.w * w.y + q.z * w.x - q.x * w.z, q.w * w.z + q.x * w.y - q.y * w.x};
}

static Vector spin(Vector w, Vector turn, Vector ratios) {
    return (Vector){turn.x - ratios.x * w.y * w.z, turn.y - ratios.y * w.z * w.x,
                    turn.z - ratios.z * w.x * w.y};
}

static Vector acceleration(Quaternion q, double lift, Vector push, double damping, Vector v) {
    const double a = q.x * q.z + q.w * q.y, b = q.y * q.z - q.w * q.x, c = q.x * q.x + q.y * q.y;
    return (Vector){2.0 * a * lift + push.x - damping * v.x,
                    2.0 * b * lift + push.y - damping * v.y,
                    (1.0 - 2.0 * c) * lift + push.z - damping * v.z - GRAVITY};
}

static Motion rk4(Motion m, const Drive d[3], Vector push, double damping, Vector ratios,
                  double dt) {
    const double half = 0.5 * dt, sixth = dt / 6.0;
    const Vector s1 = spin(m.w, d[0].turn, ratios), w2 = along(m.w, half, s1);
    const Vector s2 = spin(w2, d[1].turn, ratios), w3 = along(m.w, half, s2);
    const Vector s3 = spin(w3, d[1].turn, ratios), w4 = along(m.w, dt, s3);
    const Vector s4 = spin(w4, d[2].turn, ratios);
    const Quaternion t1 = turning(m.q, m.w), q2 = ahead(m.q, 0.5 * half, t1);
    const Quaternion t2 = turning(q2, w2), q3 = ahead(m.q, 0.5 * half, t2);
    const Quaternion t3 = turning(q3, w3), q4 = ahead(m.q, half, t3);
    const Quaternion t4 = turning(q4, w4);
    Quaternion q = ahead(ahead(t1, 1.0, t4), 2.0, ahead(t2, 1.0, t3));
    q = ahead(m.q, 0.5 * sixth, q);
    const double unit = 1.0 / sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    const Vector a1 = acceleration(m.q, d[0].lift, push, damping, m.v), v2 = along(m.v, half, a1);
    const Vector a2 = acceleration(q2, d[1].lift, push, damping, v2), v3 = along(m.v, half, a2);
    const Vector a3 = acceleration(q3, d[1].lift, push, damping, v3), v4 = along(m.v, dt, a3);
    const Vector a4 = acceleration(q4, d[2].lift, push, damping, v4);
    return (Motion){
        along(m.p, sixth, along(along(m.v, 1.0, v4), 2.0, along(v2, 1.0, v3))),
        along(m.v, sixth, along(along(a1, 1.0, a4), 2.0, along(a2, 1.0, a3))),
        {unit * q.w, unit * q.x, unit * q.y, unit * q.z},
        along(m.w, sixth, along(along(s1, 1.0, s4), 2.0, along(s2, 1.0, s3)))};
}

/* ---- battery */
static double open_voltage(double charge) {
    static const double curve[] = {3.0,  3.68, 3.74, 3.77, 3.79, 3.82,
                                   3.87, 3.92, 3.98, 4.06, 4.2};
    const double tenths = 10.0 * clamp(charge, 0.0, 1.0);
    const int below = tenths < 9.0 ? (int)tenths : 9;
    return CELLS * (curve[below] + (tenths - below) * (curve[below + 1] - curve[below]));
}

static void discharge(double v[], double duration) {
    const double disc = PI * 0.127 * 0.127; /* m^2; ideal hover power at 37 % efficiency */
    const double power_per_thrust = 1.0 / (0.37 * sqrt(2.0 * 1.2 * disc));
    const double capacity = v[BATTERY_CAPACITY] * 3600.0;
    double power = AVIONICS_POWER;
    for (int i = 0; i < 4; i++) {
        const double f = rotor_thrust(v, v[ROTOR_SPEEDS + i]);
        power += power_per_thrust * f * sqrt(f);
    }
    const double current = power / (v[VOLTAGE] > 1.0 ? v[VOLTAGE] : 1.0);
    const double left = v[CHARGE] - current * duration;
    v[CHARGE] = left > 0.0 ? left : 0.0;
    const double sagged = open_voltage(v[CHARGE] / capacity) - v[BATTERY_RESISTANCE] * current;
    v[VOLTAGE] = sagged > 0.0 ? sagged : 0.0;
}

/* ---- the model */
static Motion motion_of(const double v[]) {
    const double *q = v + QUATERNION_WB;
    return (Motion){load(v + POSITION_W), load(v + VELOCITY_W), {q[0], q[1], q[2], q[3]},
                    load(v + ANGULAR_VELOCITY_B)};
}

static void store_motion(Motion m, double v[]) {
    store(m.p, v + POSITION_W), store(m.v, v + VELOCITY_W), store(m.w, v + ANGULAR_VELOCITY_B);
    double *q = v + QUATERNION_WB;
    q[0] = m.q.w, q[1] = m.q.x, q[2] = m.q.y, q[3] = m.q.z;
}

/* What holds for a whole communication step. */
static Plant plant_of(const double v[]) {
    Plant p = {.v = v, .mass = v[MASS] + v[PAYLOAD]};
    const Motion m = motion_of(v);
    p.J = load(v + INERTIA_XX);
    p.inverse = (Vector){1.0 / p.J.x, 1.0 / p.J.y, 1.0 / p.J.z};
    p.air_w = add(load(v + WIND_X), load(v + GUST_W));
    p.force_w = add(load(v + PUSH_X), load(v + FORCE_W));
    for (int i = 0; i < 4; i++) p.gain[i] = v[MOTOR_GAIN_FRONT + i];
    const int failed = (int)v[FAILED_MOTOR];
    if (failed >= 1 && failed <= 4) p.gain[failed - 1] = 0.0;
    p.share = v[THRUST_EFFICIENCY] * ground_gain(v[GROUND_EFFECT], m.p.z) * inflow_gain(&p, &m);
    if (v[BATTERY_EXPONENT] > 0.0)
        p.share *= pow(clamp(v[VOLTAGE] / v[BATTERY_NOMINAL], 0.5, 1.5), 2.0 * v[BATTERY_EXPONENT]);
    return p;
}

/* Writes what an ideal accelerometer reads, and the thrusts. */
static void feel(const Plant *p, double v[]) {
    const Motion m = motion_of(v);
    Vector torque_b;
    Vector force_w = along(along(p->force_w, v[DRAG], p->air_w), -v[DRAG], m.v);
    if (m.p.z < CONTACT_HEIGHT) force_w = add(force_w, stand(p, &m, &torque_b));
    const Vector force_b = add(to_body(axes_of(m.q), force_w), rotor_drag(p, &m));
    store(scale(1.0 / p->mass, force_b), v + SPECIFIC_FORCE_B);
    v[SPECIFIC_FORCE_B + 2] += driven(p, v + ROTOR_SPEEDS).lift;
    for (int i = 0; i < 4; i++)
        v[THRUSTS + i] = p->share * p->gain[i] * rotor_thrust(v, v[ROTOR_SPEEDS + i]);
}

void model_begin(double v[]) {
    const double half = 0.5 * PI / 180.0; /* half an angle in rad of one in degrees */
    const double r = half * v[START_ROLL], e = half * v[START_PITCH], y = half * v[START_YAW];
    const double cr = cos(r), sr = sin(r), ce = cos(e), se = sin(e), cy = cos(y), sy = sin(y);
    store_motion((Motion){load(v + START_X),
                          load(v + START_VELOCITY_X),
                          {cr * ce * cy + sr * se * sy, sr * ce * cy - cr * se * sy,
                           cr * se * cy + sr * ce * sy, cr * ce * sy - sr * se * cy},
                          load(v + START_ANGULAR_VELOCITY_X)},
                 v);
    for (int i = 0; i < 4; i++) v[ROTOR_SPEEDS + i] = v[START_ROTOR_SPEED];
    v[CHARGE] = v[BATTERY_CHARGE] * (v[BATTERY_CAPACITY] * 3600.0);
    v[VOLTAGE] = open_voltage(v[BATTERY_CHARGE]);
    const Plant p = plant_of(v);
    feel(&p, v);
}

const char *model_step(double v[], double h) {
    const int steps = (int)ceil(h / SUBSTEP - 1e-9);
    if (steps < 1) return NULL;
    const double dt = h / steps, share = 1.0 - exp(-dt / v[MOTOR_TIME_CONSTANT]);
    const double half_share = share / (1.0 + sqrt(1.0 - share)); /* of dt / 2 */
    const Plant p = plant_of(v);
    const double by_mass = 1.0 / p.mass, *target = v + MOTOR_REFERENCES;
    const Vector J = p.J;
    const Vector ratios = times((Vector){J.z - J.y, J.x - J.z, J.y - J.x}, p.inverse);
    const Vector pull_w = along(p.force_w, v[DRAG], p.air_w);
    const int has_rotor_drag = v[ROTOR_DRAG_X] > 0.0 || v[ROTOR_DRAG_Y] > 0.0;
    double *speeds = v + ROTOR_SPEEDS, middle[4];
    Motion m = motion_of(v);
    Drive d[3] = {driven(&p, speeds)};
    for (int k = 0; k < steps; k++) {
        for (int i = 0; i < 4; i++) {
            middle[i] = speeds[i] + half_share * (target[i] - speeds[i]);
            speeds[i] = speeds[i] + share * (target[i] - speeds[i]);
        }
        const Drive end = driven(&p, speeds);
        d[1] = driven(&p, middle), d[2] = end;
        Vector force_w = pull_w, torque_b;
        if (m.p.z < CONTACT_HEIGHT) {
            force_w = add(force_w, stand(&p, &m, &torque_b));
            for (int i = 0; i < 3; i++) d[i].turn = add(d[i].turn, times(torque_b, p.inverse));
        }
        if (has_rotor_drag) {
            const Vector drag_b = rotor_drag(&p, &m);
            force_w = add(force_w, to_world(axes_of(m.q), drag_b));
            torque_b = drag_torque(v[DRAG_LEVER], drag_b);
            for (int i = 0; i < 3; i++) d[i].turn = add(d[i].turn, times(torque_b, p.inverse));
        }
        m = rk4(m, d, scale(by_mass, force_w), v[DRAG] * by_mass, ratios, dt);
        d[0] = end;
    }
    store_motion(m, v);
    feel(&p, v);
    discharge(v, h);
    const double turned = speeds[0] + speeds[1] + speeds[2] + speeds[3];
    return isfinite(dot(m.p, m.p) + dot(m.v, m.v) + dot(m.w, m.w) + m.q.w + turned)
               ? NULL
               : "the motion is no longer finite: look at inputs and parameters";
}
