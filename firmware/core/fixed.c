#include "fixed.h"

#include "constants.h"

#ifdef __AVR__
/* In the chip's own instructions: gcc makes three times as many cycles of it, and this is what most
 * of a period is. Both numbers are multiplied without a sign, and the result set right afterwards. */
int32_t by16(int32_t a, int16_t b)
{
    int32_t out;
    uint8_t low;
    uint8_t zero;
    __asm__("clr %[zero]\n\t"
            "ldi %[low], 0x80\n\t" /* rounds */
            "clr %A[out]\n\t"
            "clr %B[out]\n\t"
            "clr %C[out]\n\t"
            "clr %D[out]\n\t"
            "mul %A[a], %A[b]\n\t"
            "add %[low], r1\n\t"
            "adc %A[out], %[zero]\n\t"
            "mul %A[a], %B[b]\n\t"
            "add %[low], r0\n\t"
            "adc %A[out], r1\n\t"
            "adc %B[out], %[zero]\n\t"
            "mul %B[a], %A[b]\n\t"
            "add %[low], r0\n\t"
            "adc %A[out], r1\n\t"
            "adc %B[out], %[zero]\n\t"
            "mul %B[a], %B[b]\n\t"
            "add %A[out], r0\n\t"
            "adc %B[out], r1\n\t"
            "adc %C[out], %[zero]\n\t"
            "mul %C[a], %A[b]\n\t"
            "add %A[out], r0\n\t"
            "adc %B[out], r1\n\t"
            "adc %C[out], %[zero]\n\t"
            "mul %C[a], %B[b]\n\t"
            "add %B[out], r0\n\t"
            "adc %C[out], r1\n\t"
            "adc %D[out], %[zero]\n\t"
            "mul %D[a], %A[b]\n\t"
            "add %B[out], r0\n\t"
            "adc %C[out], r1\n\t"
            "adc %D[out], %[zero]\n\t"
            "mul %D[a], %B[b]\n\t"
            "add %C[out], r0\n\t"
            "adc %D[out], r1\n\t"
            "clr r1\n\t" /* gcc's register of zero */
            "sbrs %D[a], 7\n\t"
            "rjmp 1f\n\t"
            "sub %C[out], %A[b]\n\t"
            "sbc %D[out], %B[b]\n"
            "1:\n\t"
            "sbrs %B[b], 7\n\t"
            "rjmp 2f\n\t"
            "sub %A[out], %A[a]\n\t"
            "sbc %B[out], %B[a]\n\t"
            "sbc %C[out], %C[a]\n\t"
            "sbc %D[out], %D[a]\n"
            "2:"
            : [out] "=&r"(out), [low] "=&d"(low), [zero] "=&r"(zero)
            : [a] "r"(a), [b] "r"(b));
    return out;
}
#else
int32_t by16(int32_t a, int16_t b)
{
    const int16_t high = (int16_t)(a >> 16);
    const uint16_t low = (uint16_t)((uint32_t)a & 0xFFFFU);
    return product(high, b) + ((((int32_t)low * b) + 0x8000) >> 16);
}
#endif

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
