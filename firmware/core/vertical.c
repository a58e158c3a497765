/* Height and climb rate by barometer and accelerometer: an observer with three equal poles, and a
 * second one that follows the accelerometer and judges the first. */
#include "constants.h"
#include "fixed.h"
#include "program.h"

/* Hold the climb rate at 0; learn the bias of the vertical force (2^-14 count). */
static void rest(struct program *p, int32_t force, int32_t barometer)
{
    const int32_t off = bounded(force - (p->climb_bias >> 8), SHAKING);
    p->climb_bias =
        bounded(p->climb_bias + by16(up(off, 8), p->gains.bias_resting), CLIMB_BIAS_MAX);
    p->height +=
        by16(bounded(barometer - p->height, HEIGHT_ERROR_MAX), p->gains.height_resting);
    p->climb = 0;
    p->felt_climb = 0;
    p->doubted = 0;
    p->felt_bias = p->climb_bias;
    if (!p->turning) {
        p->ground = p->height;
    }
}

/* Update the accelerometer's climb rate by the vertical force (2^-14 count), and the doubt. */
static void doubt(struct program *p, int32_t force)
{
    const struct gains *g = &p->gains;
    int32_t felt = p->felt_climb + by16(force - (p->felt_bias >> 8), g->up);
    const int32_t off = bounded(p->climb - felt, DOUBT_MAX);
    if (p->doubted <= DOUBT_TIME) {
        felt += by16(off, g->felt);
        p->felt_bias = bounded(p->felt_bias - by16(off, g->felt_bias), CLIMB_BIAS_MAX);
    } else {
        p->ground += (by16(off, g->second) + 0x200) >> 10;
        if (!p->landing) {
            felt -= by16(felt, g->felt); /* in a room no climb lasts */
        }
    }
    if (p->landing && (p->force_b[2] > SHOCK)) {
        felt = 0;
    }
    p->felt_climb = bounded(felt, CLIMB_MAX);
    if ((off > -DOUBT) && (off < DOUBT)) {
        p->doubted = (p->doubted > g->second) ? (p->doubted - g->second) : 0;
        return;
    }
    p->doubted += g->second;
    if (p->doubted > DOUBT_TIME) {
        p->doubted = DOUBT_LASTS;
    }
}

int32_t climb_rate(const struct program *p)
{
    return (p->doubted > DOUBT_TIME) ? p->felt_climb : p->climb;
}

void estimate_climb(struct program *p, int32_t barometer)
{
    const struct gains *g = &p->gains;
    if (!p->awake) {
        p->height = barometer;
    }
    int32_t force = -GRAVITY_COUNTS;
    for (uint8_t i = 0; i < 3U; i++) {
        force += product(vertical(p, i), p->force_b[i]);
    }
    const bool light = (p->thrust < STANDING) && (p->commanded < STANDING);
    if (!p->turning || (light && (force > -SHAKING) && (force < SHAKING))) {
        rest(p, force, barometer);
        return;
    }
    const int32_t climb = p->climb + by16(force - (p->climb_bias >> 8), g->up);
    const int32_t height = p->height + ((by16(climb, g->second) + 0x200) >> 10);
    const int32_t error = bounded(barometer - height, HEIGHT_ERROR_MAX);
    p->height = height + by16(error, g->height);
    p->climb = bounded(climb + by16(up(error, 3), g->climb), CLIMB_MAX);
    p->climb_bias = bounded(p->climb_bias - by16(up(error, 8), g->bias), CLIMB_BIAS_MAX);
    doubt(p, force);
}
