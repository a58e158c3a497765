/* Height and climb rate by barometer and accelerometer: an observer with three equal poles. */
#include "constants.h"
#include "fixed.h"
#include "program.h"

void estimate_climb(struct program *p, int32_t barometer)
{
    const struct gains *g = &p->gains;
    if (!p->awake) {
        p->height = barometer;
        p->climb = 0;
        p->climb_bias = 0;
    }
    int32_t force = -GRAVITY_COUNTS - (p->climb_bias >> 8);
    for (uint8_t i = 0; i < 3U; i++) {
        force += product(vertical(p, i), p->force_b[i]);
    }
    const int32_t climb = p->climb + by16(force, g->up);
    const int32_t height = p->height + ((by16(climb, g->second) + 0x200) >> 10);
    const int32_t error = bounded(barometer - height, HEIGHT_ERROR_MAX);
    p->height = height + by16(error, p->turning ? g->height : g->height_resting);
    p->climb = bounded(climb + by16(up(error, 3), p->turning ? g->climb : g->climb_resting),
                       CLIMB_MAX);
    p->climb_bias = bounded(
        p->climb_bias - by16(up(error, 8), p->turning ? g->bias : g->bias_resting),
        CLIMB_BIAS_MAX);
    if (!p->turning) {
        p->ground = p->height;
    }
}
