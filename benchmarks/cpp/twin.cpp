// What ctypes calls; see benchmarks/twin.py.
#include "plant.hpp"

extern "C" {

int64_t size_of_onboard() { return sizeof(Onboard); }
int64_t size_of_settings() { return sizeof(Settings); }
int64_t size_of_plant() { return sizeof(Plant); }

void onboard_step(Onboard* v, const Settings* s, const ImuSample* imu, double t, int airborne,
                  double dt) {
    predict(v->estimator, *imu, s->estimation, dt, v->state);
    steer(*v, *s, t, airborne, dt);
}

void onboard_steps(Onboard* v, const Settings* s, const ImuSample* imu, double* thrusts, int airborne,
                   double dt, int64_t count) {
    for (int64_t k = 0; k < count; ++k) {
        onboard_step(v, s, imu + k, k * dt, airborne, dt);
        for (int i = 0; i < 4; ++i) thrusts[4 * k + i] = v->actuators.thrusts[i];
    }
}

// The true-state loop; returns the rms position error (m) judged at every tick's beginning.
double fly_true_state(const Settings* s, Plant* p, Onboard* v, int64_t ticks, double period,
                      int substeps) {
    double dt = period / substeps, share = 1.0 - std::exp(-dt / p->model.motor_time_constant);
    double squares = 0.0;
    for (int64_t k = 0; k < ticks; ++k) {
        State& state = v->state;
        std::copy(p->x, p->x + 3, state.position_w);
        std::copy(p->x + 3, p->x + 6, state.velocity_w);
        std::copy(p->x + 6, p->x + 10, state.quaternion_wb);
        std::copy(p->x + 10, p->x + 13, state.angular_velocity_b);
        steer(*v, *s, k * period, true, period);
        Vec e = load(v->reference.position_w) - load(p->x);
        squares += dot(e, e);
        move(*p, v->actuators.motor_references, substeps, dt, share);
    }
    return std::sqrt(squares / ticks);
}
}
