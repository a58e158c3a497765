/* Mahony's passive filter of the vertical, with gyroscope drift. */
#include "constants.h"
#include "fixed.h"
#include "program.h"

int16_t vertical(const struct program *p, uint8_t axis)
{
    return narrow(p->up_b[axis] >> 16);
}

static int16_t scaled(int32_t across, int16_t inverse)
{
    return narrow_down(product(narrow_down(across + 0x80, 8), inverse) + 0x2000, 14);
}

/* The rotation vector (2^-14 rad) from the vertical to the force's direction. */
static void correction(const int16_t f[3], const int16_t u[3], int16_t c[3])
{
    const int32_t square = product(f[0], f[0]) + product(f[1], f[1]) + product(f[2], f[2]);
    if ((square <= FORCE_SQUARE_MIN) || (square >= FORCE_SQUARE_MAX)) {
        c[0] = 0;
        c[1] = 0;
        c[2] = 0;
        return;
    }
    const int16_t inverse = narrow(INVERSE_NEAR - by16(square, narrow(INVERSE_SLOPE)));
    c[0] = scaled(product(f[1], u[2]) - product(f[2], u[1]), inverse);
    c[1] = scaled(product(f[2], u[0]) - product(f[0], u[2]), inverse);
    c[2] = scaled(product(f[0], u[1]) - product(f[1], u[0]), inverse);
}

static void measure_rate(struct program *p, const int16_t omega_b[3])
{
    for (uint8_t i = 0; i < 3U; i++) {
        p->rate_b[i] = up(omega_b[i], 16) - (p->drift[i] >> 8);
    }
}

void estimate_attitude(struct program *p, const int16_t omega_b[3], const int16_t force_b[3])
{
    const struct gains *g = &p->gains;
    int16_t u[3];
    int16_t c[3];
    bool still = !p->turning;
    measure_rate(p, omega_b);
    for (uint8_t i = 0; i < 3U; i++) {
        p->force_b[i] = force_b[i];
        still = still && (p->rate_b[i] > -STILL) && (p->rate_b[i] < STILL);
    }
    if (still) {
        for (uint8_t i = 0; i < 3U; i++) {
            p->drift[i] = bounded(p->drift[i] + by16(up(p->rate_b[i], 2), g->rest), DRIFT_MAX);
        }
        measure_rate(p, omega_b);
    }
    for (uint8_t i = 0; i < 3U; i++) {
        u[i] = vertical(p, i);
    }
    correction(force_b, u, c);
    int16_t gain = narrow(CORRECTION_RESTING);
    if (p->turning) {
        const int32_t square = product(c[0], c[0]) + product(c[1], c[1]) + product(c[2], c[2]);
        const bool turned = square >= TURNED_SQUARE;
        const int16_t learnt = turned ? g->drift_turned : g->drift;
        gain = narrow(turned ? CORRECTION_TURNED : CORRECTION_FLYING);
        for (uint8_t i = 0; i < 3U; i++) {
            const int32_t change = (product(c[i], learnt) + 0x2000) >> 14;
            p->drift[i] = bounded(p->drift[i] - change, DRIFT_MAX);
        }
    }
    int32_t phi[3]; /* 2^-32 rad */
    for (uint8_t i = 0; i < 3U; i++) {
        phi[i] = up(by16(p->rate_b[i] + (product(c[i], gain) >> 4), g->turn), 2);
    }
    /* up x phi, and back to length 1 by one step of Newton's. */
    p->up_b[0] += by16(phi[2], u[1]) - by16(phi[1], u[2]);
    p->up_b[1] += by16(phi[0], u[2]) - by16(phi[2], u[0]);
    p->up_b[2] += by16(phi[1], u[0]) - by16(phi[0], u[1]);
    int32_t short_by = INT32_C(1) << 28;
    for (uint8_t i = 0; i < 3U; i++) {
        u[i] = vertical(p, i);
        short_by -= product(u[i], u[i]);
    }
    for (uint8_t i = 0; i < 3U; i++) {
        p->up_b[i] += by16(p->up_b[i], narrow_down(short_by, 13));
        u[i] = vertical(p, i);
    }
    p->roll = angle_of(u[1], u[2]);
    const uint32_t across = (uint32_t)(product(u[1], u[1]) + product(u[2], u[2]));
    p->pitch = -angle_of(u[0], narrow(root(across)));
}
