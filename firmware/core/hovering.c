/* The near-hovering law: angles, yaw rate and thrust to four motor references. */
#include "constants.h"
#include "fixed.h"
#include "program.h"

#define ALL INT32_C(32768) /* the scaling of thrusts that are within their limits */

/* The angular acceleration about one axis, of the unit of the gains. */
static int32_t acceleration(int32_t error, int32_t integral, int32_t rate, const int16_t *registers)
{
    const int32_t held =
        by16(up(error, 8), registers[ID_GAIN_P]) + (by16(integral, registers[ID_GAIN_I]) >> 7);
    const int32_t damping = by16(by16(up(rate, 4), registers[ID_GAIN_D]), narrow(RATE_GAIN));
    return bounded(held - damping, ACCELERATION_MAX);
}

static uint8_t reference_of(int32_t rest, int32_t scaling)
{
    const int32_t share = (scaling == ALL) ? rest : by16(up(rest, 1), narrow(scaling));
    const int32_t thrust = within(THRUST_HOVER + share, THRUST_MIN, THRUST_MAX);
    const uint32_t speed = (uint32_t)root((uint32_t)thrust << 16) * (uint16_t)REFERENCE_SLOPE;
    const int32_t reference = ((int32_t)(speed >> 15) - REFERENCE_OFFSET + 0x80) >> 8;
    return (uint8_t)((reference > REFERENCE_MAX) ? REFERENCE_MAX : reference);
}

/* Set the references for a thrust and shares of torque (2^-12 N), scaled uniformly to be feasible;
 * return the scaling, 2^-15. */
static int32_t allocate(struct program *p, int32_t thrust, int32_t roll, int32_t pitch, int32_t yaw)
{
    const int32_t base = (thrust >> 2) - THRUST_HOVER;
    const int32_t rest[MOTORS] = {
        base - pitch + yaw, base + roll - yaw, base + pitch + yaw, base - roll - yaw};
    int32_t most = rest[0];
    int32_t least = rest[0];
    for (uint8_t i = 1; i < MOTORS; i++) {
        most = (rest[i] > most) ? rest[i] : most;
        least = (rest[i] < least) ? rest[i] : least;
    }
    int32_t scaling = ALL;
    if (most > (THRUST_MAX - THRUST_HOVER)) {
        scaling = ((THRUST_MAX - THRUST_HOVER) * ALL) / most;
    }
    if (least < (THRUST_MIN - THRUST_HOVER)) {
        const int32_t other = ((THRUST_HOVER - THRUST_MIN) * ALL) / -least;
        scaling = (other < scaling) ? other : scaling;
    }
    for (uint8_t i = 0; i < MOTORS; i++) {
        p->references[i] = reference_of(rest[i], scaling);
    }
    return scaling;
}

static int32_t integrated(const struct program *p, uint8_t axis, int32_t error)
{
    const int32_t change = (product(narrow(error), p->gains.integral) + 0x80) >> 8;
    return bounded(p->integral[axis] + change, INTEGRAL_MAX);
}

static int32_t size(int32_t value)
{
    return (value < 0) ? -value : value;
}

void hold_angles(struct program *p, int16_t *registers, const int32_t wanted[3], int32_t thrust)
{
    const int32_t roll = wanted[0] - p->roll;
    const int32_t pitch = wanted[1] - p->pitch;
    const int32_t x = acceleration(roll, p->integral[0], p->rate_b[0], registers);
    const int32_t y = acceleration(pitch, p->integral[1], p->rate_b[1], registers);
    const int32_t change = bounded(
        by16(p->rate_b[2] - p->rate_before, registers[ID_GAIN_YAW_ACCELERATION]), YAW_CHANGE_MAX);
    p->rate_before = p->rate_b[2];
    const int32_t turn =
        by16(by16(up(wanted[2] - p->rate_b[2], 4), registers[ID_GAIN_YAW_RATE]), narrow(RATE_GAIN));
    const int32_t z =
        bounded(turn - product(narrow(change), p->gains.yaw_slope), ACCELERATION_MAX);
    const int32_t scaling = allocate(p, thrust, by16(x, narrow(SHARE_ROLL)),
                                     by16(y, narrow(SHARE_PITCH)),
                                     by16(up(z, 2), narrow(SHARE_YAW)));
    if ((scaling == ALL) && ((size(roll) + size(pitch)) < INTEGRATED)) {
        p->integral[0] = integrated(p, 0, roll);
        p->integral[1] = integrated(p, 1, pitch);
    }
    registers[ID_TORQUE_ROLL] = narrow(bounded(by16(x, narrow(MILLI_ROLL)), INT16_MAX));
    registers[ID_TORQUE_PITCH] = narrow(bounded(by16(y, narrow(MILLI_PITCH)), INT16_MAX));
    registers[ID_TORQUE_YAW] = narrow(bounded(by16(z, narrow(MILLI_YAW)), INT16_MAX));
}
