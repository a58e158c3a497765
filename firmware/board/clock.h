/* The period of estimation and control, by timer 1, which also starts the converters. */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

/* Set the period, 1000 to 2000 us. */
void clock_set_period(uint16_t period_us);

/* Begin the first period. */
void clock_begin(void);

/* Sleep until the next period; return how many began since the last call. */
uint8_t clock_wait(void);

#endif
