/* The analog pressure sensor, whose amplifier shows 1.8 kPa of its range at a time. */
#ifndef PRESSURE_H
#define PRESSURE_H

#include <stdint.h>

void pressure_begin(void);

/* Return Pa - 90000, within 16 bits. */
int16_t pressure_of(int16_t count);

/* Move the range until the reading is well inside; only while the motors are off. */
void pressure_find(int16_t count, uint32_t ms);

#endif
