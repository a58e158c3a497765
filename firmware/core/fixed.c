#include "fixed.h"

#include "constants.h"

uint16_t root(uint32_t square)
{
    uint32_t rest = square;
    uint32_t out = 0;
    uint32_t bit = UINT32_C(1) << 30;
    for (uint8_t i = 0; i < 16U; i++) {
        const uint32_t test = out + bit;
        out >>= 1;
        if (rest >= test) {
            rest -= test;
            out += bit;
        }
        bit >>= 2;
    }
    return (uint16_t)out;
}

/* Return low / high, 2^-15 and at most 32767, of 0 <= low <= high <= 32767. */
static int16_t quotient(uint16_t low, uint16_t high)
{
    uint16_t rest = low;
    uint16_t out = 0;
    if (low == high) {
        return INT16_MAX;
    }
    for (uint8_t i = 0; i < 15U; i++) {
        rest = (uint16_t)(rest << 1);
        out = (uint16_t)(out << 1);
        if (rest >= high) {
            rest = (uint16_t)(rest - high);
            out |= 1U;
        }
    }
    return (int16_t)out;
}

int32_t angle_of(int16_t y, int16_t x)
{
    const uint16_t tall = (uint16_t)((y < 0) ? -y : y);
    const uint16_t wide = (uint16_t)((x < 0) ? -x : x);
    const uint16_t high = (tall > wide) ? tall : wide;
    const uint16_t low = (tall > wide) ? wide : tall;
    if (high == 0U) {
        return 0;
    }
    const int16_t t = quotient(low, high);
    const int16_t square = by15(t, t);
    int16_t sum = narrow(ATAN_7 + by15(square, narrow(ATAN_9)));
    sum = narrow(ATAN_5 + by15(square, sum));
    sum = narrow(ATAN_3 + by15(square, sum));
    sum = narrow(ATAN_1 + by15(square, sum));
    int32_t out = ((product(t, sum) + 0x4000) * 2) >> 16;
    if (tall > wide) {
        out = QUARTER_TURN - out;
    }
    if (x < 0) {
        out = HALF_TURN - out;
    }
    return (y < 0) ? -out : out;
}
