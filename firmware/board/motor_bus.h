/* The motor controllers on the two-wire bus: each period, one byte to each of the four. */
#ifndef MOTOR_BUS_H
#define MOTOR_BUS_H

#include <stdint.h>

#include "program.h"

void motor_bus_begin(void);

/* Begin to send the references; interrupts do the rest. What is unfinished is given up. */
void motor_bus_send(const uint8_t references[MOTORS]);

/* Return the bits of the motors whose controllers do not answer. */
uint8_t motor_bus_missing(void);

#endif
