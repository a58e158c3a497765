/* One period of estimation and control: from converter counts to motor references. */
#ifndef PROGRAM_H
#define PROGRAM_H

#include <stdbool.h>
#include <stdint.h>

#define MOTORS 4U

/* Gains that grow with the period. */
struct gains {
    int16_t turn, rest, drift, drift_turned, second, up;
    int16_t height, height_resting, climb, bias, bias_resting, felt, felt_bias;
    int16_t integral, thrust, support, lift, shown, pulling;
    int16_t yaw_slope;
};

/* What is kept between periods; 2^-n of the unit. */
struct program {
    int32_t up_b[3];        /* 2^-30: the world's z axis in body axes, a unit vector */
    int32_t drift[3];       /* 2^-24 count, subtracted from what the gyroscope measures */
    int32_t rate_b[3];      /* 2^-16 count */
    int16_t force_b[3];     /* count */
    int32_t roll, pitch;    /* 2^-15 rad */
    int32_t height;         /* 2^-18 m, of the barometer's scale */
    int32_t climb;          /* 2^-22 m/s */
    int32_t climb_bias;     /* 2^-22 count, of the vertical specific force */
    int32_t ground;         /* 2^-18 m, height of the last rest with motors off */
    int32_t felt_climb;     /* 2^-22 m/s, by the accelerometer; the barometer only slowly */
    int32_t felt_bias;      /* 2^-22 count, of the vertical specific force, for that */
    int32_t doubted;        /* 2^-22 s, the barometer contradicts the accelerometer */
    int32_t integral[2];    /* 2^-30 rad s, roll and pitch */
    int32_t rate_before;    /* 2^-16 count, yaw rate one period ago */
    int32_t commanded;      /* 2^-24 N, thrust of the motors' references */
    int32_t thrust;         /* 2^-24 N, commanded, averaged */
    int32_t support;        /* 2^-28, specific force over what the thrust gives in the air */
    int32_t lift;           /* 2^-24 N, integral part of the descent's thrust */
    int32_t sink;           /* 2^-22 m/s, wanted in the descent */
    int32_t lasted;         /* 2^-22 s, duration of the descent */
    int32_t longest;        /* 2^-18 s, duration from which on it becomes faster */
    int32_t faster;         /* 2^-22 m/s, of a descent that should have ended */
    int32_t carried;        /* 2^-22 s, the ground has carried the vehicle */
    int32_t struck;         /* 2^-22 s, since the ground hit the feet last */
    int32_t try_at;         /* 2^-22 s, from which on this presumes the ground */
    int32_t shown;          /* 2^-16 count, mean specific force along z_B in the descent */
    int32_t pulling;        /* 2^-24 N, commanded thrust with the motors' lag */
    int32_t held;           /* 2^-24 N, the descent's thrust before a test of the ground */
    int32_t unloaded;       /* 2^-24 N, taken off the thrust to test the ground; 0 without a test */
    int32_t began_at;       /* 2^-16 count, specific force by the thrust when the test began */
    int32_t tested;         /* 2^-22 s, duration of the test */
    int32_t falling;        /* 2^-22 s, it has shown the air */
    int32_t refuted;        /* 2^-28, the support that looked like the ground */
    uint8_t references[MOTORS];
    uint8_t missing;        /* bits of the motors whose controllers do not answer */
    uint8_t state;          /* of the last period */
    bool turning;           /* motors on, commanded or by itself */
    bool landing;           /* the descent is in control */
    bool landed;            /* the descent is over */
    bool awake;             /* the height is initialised */
    struct gains gains;
};

/* A program as at power-up. */
void program_begin(struct program *p);

/* Set the gains for a period in 1/16 us. */
void program_set_period(struct program *p, uint16_t sixteenths);

/* Run estimation, then control; the command's bytes mean what the mode's register says. */
void program_run(struct program *p, int16_t *registers, const uint8_t command[MOTORS]);

/* ---- its parts */
void estimate_attitude(struct program *p, const int16_t omega_b[3], const int16_t force_b[3]);
int16_t vertical(const struct program *p, uint8_t axis);
void estimate_climb(struct program *p, int32_t barometer);
int32_t climb_rate(const struct program *p);
void hold_angles(struct program *p, int16_t *registers, const int32_t wanted[3], int32_t thrust);
void watch_thrust(struct program *p);
void begin_descent(struct program *p);
void descend(struct program *p, int16_t *registers);
void stop_motors(struct program *p);

#endif
