/* The two serial lines: interrupts move bytes between them and rings of 255 bytes. */
#ifndef UART_H
#define UART_H

#include <stdint.h>

void uart_begin(void);

/* Return how many bytes of a line wait. */
uint8_t uart_waiting(uint8_t port);

/* Return the oldest byte that waits; there must be one. */
uint8_t uart_take(uint8_t port);

/* Send bytes, all or, if the ring has no room, none. */
void uart_send(uint8_t port, const uint8_t *bytes, uint8_t count);

#endif
