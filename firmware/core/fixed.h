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
    return (int32_t)a * b;
}

/* Return a b / 2^16, rounded. */
int32_t by16(int32_t a, int16_t b);

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
