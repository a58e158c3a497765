/* Arithmetic of whole numbers: products that keep 32 of 48 bits, roots, angles.
 * Shifts of negative numbers are arithmetic, as gcc defines them on every target. */
#ifndef FIXED_H
#define FIXED_H

#include <stdbool.h>
#include <stdint.h>

/* cppcheck-suppress shiftNegativeLHS */
_Static_assert((-3 >> 1) == -2, "shifts of negative numbers must be arithmetic");

/* Return a b. */
static inline int32_t product(int16_t a, int16_t b)
{
#ifdef __AVR__
    /* gcc calls a function, which takes twice as many cycles. */
    int32_t out;
    uint8_t zero;
    __asm__("clr %[zero]\n\t"
            "muls %B[a], %B[b]\n\t"
            "movw %C[out], r0\n\t"
            "mul %A[a], %A[b]\n\t"
            "movw %A[out], r0\n\t"
            "mulsu %B[a], %A[b]\n\t"
            "sbc %D[out], %[zero]\n\t" /* its sign */
            "add %B[out], r0\n\t"
            "adc %C[out], r1\n\t"
            "adc %D[out], %[zero]\n\t"
            "mulsu %B[b], %A[a]\n\t"
            "sbc %D[out], %[zero]\n\t"
            "add %B[out], r0\n\t"
            "adc %C[out], r1\n\t"
            "adc %D[out], %[zero]\n\t"
            "clr r1" /* gcc's register of zero */
            : [out] "=&r"(out), [zero] "=&r"(zero)
            : [a] "a"(a), [b] "a"(b));
    return out;
#else
    return (int32_t)a * b;
#endif
}

/* Return a b / 2^16, rounded. */
static inline int32_t by16(int32_t a, int16_t b)
{
#ifdef __AVR__
    /* gcc makes three times as many cycles of it, and this is what most of a period is. Both numbers
     * are multiplied without a sign, and the result set right afterwards. */
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
#else
    const int16_t high = (int16_t)(a >> 16);
    const uint16_t low = (uint16_t)((uint32_t)a & 0xFFFFU);
    return product(high, b) + ((((int32_t)low * b) + 0x8000) >> 16);
#endif
}

/* Return a b / 2^15, rounded down. */
static inline int16_t by15(int16_t a, int16_t b)
{
    return (int16_t)((uint32_t)(product(a, b) * 2) >> 16);
}

/* Return the low 16 bits of a number that fits them. */
static inline int16_t narrow(int32_t value)
{
    return (int16_t)value;
}

/* Return value 2^bits; value may be negative. */
static inline int32_t up(int32_t value, uint8_t bits)
{
    return (int32_t)((uint32_t)value << bits);
}

/* Return the low 16 bits of value / 2^bits, of 8 to 16 bits: up and two bytes away, as the chip
 * shifts by one bit at a time. */
static inline int16_t narrow_down(int32_t value, uint8_t bits)
{
    return (int16_t)(uint16_t)((uint32_t)up(value, (uint8_t)(16U - bits)) >> 16);
}

/* Return value within low and high. */
static inline int32_t within(int32_t value, int32_t low, int32_t high)
{
    return (value < low) ? low : ((value > high) ? high : value);
}

/* Return value within -most and most. */
static inline int32_t bounded(int32_t value, int32_t most)
{
    return within(value, -most, most);
}

/* Return whether a bit of a byte is set. */
static inline bool is_set(uint8_t byte, uint8_t bit)
{
    return ((uint8_t)(byte >> bit) & 1U) != 0U;
}

/* Return the whole part of the root of a number. */
uint16_t root(uint32_t square);

/* Return atan2(y, x) in 2^-15 rad; 0 where both are 0. Neither is -32768. */
int32_t angle_of(int16_t y, int16_t x);

#endif
