// The project's numpy records as C structs: the same memory, so both sides fly the same vehicle.
#pragma once
#include <cstdint>

struct EstimationGains {
    double position_bandwidth, accelerometer_bias_bandwidth, attitude_bandwidth;
    double gyroscope_bias_bandwidth, rate_low_pass, rate_notch, rate_notch_width;
    double norm_penalty;
    double accelerometer_bias_limit, gyroscope_bias_limit;
    double pose_gate, pose_position_noise, pose_attitude_noise;
};

struct ControlGains {
    double kp[3], kv[3], ki[3], kr[3], kw[3], kf[3];
    double tan_tilt_max, position_integral_max, attitude_integral_max, yaw_torque_max;
    int64_t exact_rates;
};

struct Model {
    double mass, inertia_b[3], arm, torque_ratio, motor_time_constant, motor_slope, motor_offset;
    double thrust_min, thrust_max, drag, drag_lever;
};

struct Eight {
    double center[4], amplitude[4], rate, ramp, total;
};

struct Observer {
    int64_t force, torque;
    double force_bandwidth, torque_bandwidth, force_max, torque_max, fade;
};

struct ObserverMemory {
    int64_t running;
    double rotor_speeds[4], velocity_w[3], angular_velocity_b[3], acceleration_w[3];
    double z_w[3], slow_acceleration_w[3], rate_w[3], slow_rate_w[3], turn_b[3], force_share, torque_share;
};

struct Settings {
    EstimationGains estimation;
    ControlGains control;
    Model model;
    Eight eight;
    Observer observer;
};

constexpr int kHistory = 256;

struct EstimatorMemory {
    uint8_t initialized, primed;
    int64_t stamp_ns, pose_stamp_ns, started_ns, outcomes[6];
    double position_spread, attitude_spread;
    int64_t newest_ns, agreement;
    double position_scale, attitude_scale, distance, last_offset_w[3], last_turn;
    int64_t jumped, run_count, run_start_ns, run_ns;
    double run_first_w[3], run_offset_w[3], run_turn[4];
    double pose[7], past[7], velocity_w[3], filtered_rate_b[3], notch_hz, notch_b[3][2];
    double accelerometer_bias_b[3], gyroscope_bias_b[3], specific_force_b[3], rate_b[3];
    int64_t ring_next, ring_count, ring_stamp_ns[kHistory];
    double ring_pose[kHistory][7];
};

struct ControlMemory {
    double position_integral_w[3], attitude_integral_b[3], desired_attitude[3][3];
    int64_t tilt_limited;
    double disturbing_force_w[3], disturbing_lift, disturbing_force_rate_w[3], disturbing_force_curve_w[3];
    double disturbing_torque_b[3];
    double force_begun, torque_begun, force_ended_w[3], torque_ended_b[3];
};

struct ImuSample {
    int64_t stamp_ns;
    double specific_force_b[3], angular_velocity_b[3];
};

struct State {
    double position_w[3], velocity_w[3], quaternion_wb[4], angular_velocity_b[3];
};

struct Reference {
    double position_w[3], velocity_w[3], acceleration_w[3], jerk_w[3], snap_w[3];
    double yaw, yaw_rate, yaw_acceleration;
};

struct Actuators {
    double wrench[4], thrusts[4], motor_references[4], scaling;
};

struct Estimate {
    double mass, mass_variance, accelerometer_bias_b[3], gyroscope_bias_b[3];
    double position_innovation_w[3], attitude_innovation_b[3], measurement_age;
    uint32_t measurements_used, measurements_refused, measurements_ignored;
    uint8_t agreement;
    double nis;
    int32_t nis_freedom;
    double consistency, refused_share;
    double accelerometer_noise_scale, gyroscope_noise_scale, measurement_noise_scale;
    double position_variance_w[3], velocity_variance_w[3], attitude_variance_w[3];
};

struct Onboard {
    EstimatorMemory estimator;
    ControlMemory controller;
    ImuSample imu;
    State state;
    Reference reference;
    Actuators actuators;
    Estimate estimate;
    ObserverMemory observer;
};

struct Plant {
    double x[13], rotor_speeds[4], specific_force_b[3], disturbance_w[3], charge, voltage;
    Model model;
    double thrust_efficiency, drag, stiffness, damping, friction, rest_depth, floor_w[3], capacity, resistance;
    double battery_nominal, battery_exponent, battery_share;
    double air_w[3], wind_w[3], gust, gust_time, motor_gain[4], ground_effect, air_share;
    double gusts[5], rotor_drag_b[3], inflow_loss, rotor_turns[4];
    // Of the faults of the body, which the twin does not have:
    double centre_b[2], products_b[3], full_inverse_b[9], load_mass, load_length, load[6];
};
