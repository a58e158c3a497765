#include "program.h"

#include <string.h>

#include "constants.h"
#include "fixed.h"

static int16_t gain(uint16_t period, int32_t factor, uint8_t shift)
{
    const uint32_t half = UINT32_C(1) << (shift - 1U);
    return (int16_t)((((uint32_t)period * (uint16_t)factor) + half) >> shift);
}

#define GAIN(period, name) gain((period), GAIN_##name, (uint8_t)GAIN_##name##_SHIFT)

void program_set_period(struct program *p, uint16_t sixteenths)
{
    const uint16_t t = (uint16_t)within(sixteenths, PERIOD_MIN, PERIOD_MAX);
    struct gains *g = &p->gains;
    g->turn = GAIN(t, TURN);
    g->rest = GAIN(t, REST);
    g->drift = GAIN(t, DRIFT);
    g->drift_turned = GAIN(t, DRIFT_TURNED);
    g->second = GAIN(t, SECOND);
    g->up = GAIN(t, UP);
    g->height = GAIN(t, HEIGHT);
    g->height_resting = GAIN(t, HEIGHT_RESTING);
    g->climb = GAIN(t, CLIMB);
    g->bias = GAIN(t, BIAS);
    g->bias_resting = GAIN(t, BIAS_RESTING);
    g->felt = GAIN(t, FELT);
    g->felt_bias = GAIN(t, FELT_BIAS);
    g->integral = GAIN(t, INTEGRAL);
    g->thrust = GAIN(t, THRUST);
    g->support = GAIN(t, SUPPORT);
    g->lift = GAIN(t, LIFT);
    g->shown = GAIN(t, SHOWN);
    g->pulling = GAIN(t, PULLING);
    g->yaw_slope = narrow(YAW_SLOPE / (int32_t)t);
}

void program_begin(struct program *p)
{
    (void)memset(p, 0, sizeof(*p));
    p->up_b[2] = INT32_C(1) << 30;
    p->support = INT32_C(1) << 28;
    program_set_period(p, 16000);
}

/* Obey a near-hovering command: pitch, roll (deg x 4), yaw rate (deg/s), thrust. */
static void obey(struct program *p, int16_t *registers, const uint8_t command[MOTORS])
{
    const int32_t wanted[3] = {
        (int8_t)command[1] * WANTED_ANGLE,
        (int8_t)command[0] * WANTED_ANGLE,
        (int8_t)command[2] * WANTED_YAW_RATE,
    };
    hold_angles(p, registers, wanted, (command[3] * WANTED_THRUST) >> 6);
}

/* Write the estimates into the registers that can be requested. */
static void show(const struct program *p, int16_t *registers)
{
    registers[ID_ROLL] = narrow(by16(p->roll, narrow(SHOW_ANGLE)));
    registers[ID_PITCH] = narrow(by16(p->pitch, narrow(SHOW_ANGLE)));
    for (uint8_t i = 0; i < 3U; i++) {
        registers[ID_RATE_X + i] =
            narrow_down(by16(p->rate_b[i], narrow(SHOW_RATE)) + 0x400, 11);
        registers[ID_GYROSCOPE_DRIFT_X + i] =
            narrow_down(by16(p->drift[i], narrow(SHOW_DRIFT)) + 0x8000, 16);
        registers[ID_ACCELERATION_X + i] =
            narrow_down(product(p->force_b[i], narrow(SHOW_FORCE)) + 0x800, 12);
    }
    registers[ID_ROLL_RATE] = registers[ID_RATE_X];
    registers[ID_PITCH_RATE] = registers[ID_RATE_Y];
    registers[ID_YAW_RATE] = registers[ID_RATE_Z];
    registers[ID_THRUST] = narrow((by16(p->thrust, narrow(SHOW_THRUST)) + 0x40000) >> 19);
    for (uint8_t i = 0; i < MOTORS; i++) {
        const bool missing = is_set(p->missing, i);
        registers[ID_MOTOR_REFERENCE_1 + i] = missing ? -1 : p->references[i];
    }
}

static void control(struct program *p, int16_t *registers, const uint8_t command[MOTORS],
                    uint8_t state)
{
    if (state == (uint8_t)STATE_EMERGENCY) {
        if (p->state != (uint8_t)STATE_EMERGENCY) {
            begin_descent(p);
        }
        if (p->landing) {
            descend(p, registers);
        }
    } else if (state == (uint8_t)STATE_ON) {
        if (registers[ID_FLIGHT_CONTROL_MODE] == MODE_NEAR_HOVERING) {
            obey(p, registers, command);
        } else {
            for (uint8_t i = 0; i < MOTORS; i++) {
                p->references[i] = command[i];
            }
        }
    } else {
        stop_motors(p);
    }
}

void program_run(struct program *p, int16_t *registers, const uint8_t command[MOTORS])
{
    int16_t force_b[3];
    int16_t omega_b[3];
    for (uint8_t i = 0; i < 3U; i++) {
        const int32_t offset = CONVERTER_ZERO + registers[ID_ACCELEROMETER_OFFSET_X + i];
        force_b[i] = narrow(bounded(registers[ID_ACCELEROMETER_X + i] - offset, FORCE_MAX));
        omega_b[i] =
            narrow(within(registers[ID_GYROSCOPE_X + i], 0, CONVERTER_MAX) - CONVERTER_ZERO);
    }
    const uint8_t state = (uint8_t)registers[ID_MOTOR_STATE];
    p->turning = (state == (uint8_t)STATE_ON) || (state == (uint8_t)STATE_EMERGENCY);
    estimate_attitude(p, omega_b, force_b);
    estimate_climb(p, -product(narrow(HEIGHT_SLOPE), registers[ID_PRESSURE]));
    p->awake = true;
    control(p, registers, command, state);
    p->state = state;
    for (uint8_t i = 0; i < MOTORS; i++) {
        if (is_set(p->missing, i)) {
            p->references[i] = 0;
        }
    }
    watch_thrust(p);
    show(p, registers);
}
