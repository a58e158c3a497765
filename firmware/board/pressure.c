#include "pressure.h"

#include <avr/io.h>

#include "fixed.h"
#include "wiring.h"

#define WANTED 768 /* count: the pressure falls in flight */
#define LEAST 500  /* counts that are left as they are */
#define MOST 950

static uint8_t coarse = 199; /* 100 kPa */
static uint8_t fine = 127;
static uint32_t moved_ms;

static void drive(void)
{
    OCR0A = fine;
    OCR0B = coarse;
}

void pressure_begin(void)
{
    drive();
    TCCR0A = (1U << COM0A1) | (1U << COM0B1) | (1U << WGM01) | (1U << WGM00); /* fast PWM */
    TCCR0B = (1U << CS00);
    DDRB |= (uint8_t)((1U << PB3) | (1U << PB4)); /* OC0A, OC0B */
}

int16_t pressure_of(int16_t count)
{
    const int32_t pascal = (product(count, PRESSURE_FACTOR) >> 14) +
                           (PRESSURE_FINE * (fine + INT32_C(1))) +
                           (PRESSURE_COARSE * (coarse + INT32_C(1))) +
                           (PRESSURE_ZERO - INT32_C(90000));
    return narrow(within(pascal, INT16_MIN, INT16_MAX));
}

void pressure_find(int16_t count, uint32_t ms)
{
    if (((ms - moved_ms) < PRESSURE_SETTLING_MS) || ((count >= LEAST) && (count <= MOST))) {
        return;
    }
    /* A step up takes counts away. A railed reading says only which way: it takes several moves. */
    const int16_t above = (int16_t)(count - WANTED);
    const int16_t steps = (int16_t)(above / PRESSURE_COARSE_COUNTS);
    if (steps != 0) {
        coarse = (uint8_t)within(coarse + steps, 0, UINT8_MAX);
    } else {
        fine = (uint8_t)within(fine + (above / PRESSURE_FINE_COUNTS), 0, UINT8_MAX);
    }
    drive();
    moved_ms = ms;
}
