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

int32_t angle_of(int16_t y, int16_t x)
{
    const uint16_t tall = (uint16_t)((y < 0) ? -y : y);
    const uint16_t wide = (uint16_t)((x < 0) ? -x : x);
    const uint16_t high = (tall > wide) ? tall : wide;
    const uint16_t low = (tall > wide) ? wide : tall;
    if (high == 0U) {
        return 0;
    }
    uint32_t quotient = ((uint32_t)low << 15) / high;
    if (quotient > 32767U) {
        quotient = 32767U;
    }
    const uint16_t t = (uint16_t)quotient;
    const uint16_t square = (uint16_t)(((uint32_t)t * t) >> 15);
    int16_t sum = narrow(ATAN_7 + by15(square, narrow(ATAN_9)));
    sum = narrow(ATAN_5 + by15(square, sum));
    sum = narrow(ATAN_3 + by15(square, sum));
    sum = narrow(ATAN_1 + by15(square, sum));
    int32_t out = (((int32_t)t * sum) + 0x4000) >> 15;
    if (tall > wide) {
        out = QUARTER_TURN - out;
    }
    if (x < 0) {
        out = HALF_TURN - out;
    }
    return (y < 0) ? -out : out;
}
