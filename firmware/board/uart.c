#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#include "firmware.h"
#include "wiring.h"

#define RING 256U /* an index of 8 bits wraps by itself; one byte stays free */

struct ring {
    volatile uint8_t bytes[RING];
    volatile uint8_t head, tail; /* where the next byte comes to; the oldest */
};

static struct ring received[PORTS_MAX];
static struct ring sending[PORTS_MAX];

void uart_begin(void)
{
    UBRR0 = UART_DIVISOR;
    UBRR1 = UART_DIVISOR;
    UCSR0C = (1U << UCSZ01) | (1U << UCSZ00); /* 8N1 */
    UCSR1C = (1U << UCSZ11) | (1U << UCSZ10);
    UCSR0B = (1U << RXCIE0) | (1U << RXEN0) | (1U << TXEN0);
    UCSR1B = (1U << RXCIE1) | (1U << RXEN1) | (1U << TXEN1);
}

static uint8_t filled(const struct ring *ring)
{
    return (uint8_t)(ring->head - ring->tail);
}

static inline void keep(struct ring *ring, uint8_t byte)
{
    const uint8_t head = ring->head;
    if ((uint8_t)(head + 1U) != ring->tail) { /* a lost byte damages a frame: its checksum tells */
        ring->bytes[head] = byte;
        ring->head = (uint8_t)(head + 1U);
    }
}

static inline uint8_t oldest(struct ring *ring)
{
    const uint8_t tail = ring->tail;
    ring->tail = (uint8_t)(tail + 1U);
    return ring->bytes[tail];
}

ISR(USART0_RX_vect)
{
    keep(&received[0], UDR0);
}

ISR(USART1_RX_vect)
{
    keep(&received[1], UDR1);
}

ISR(USART0_UDRE_vect)
{
    if (filled(&sending[0]) == 0U) {
        UCSR0B &= (uint8_t)~(1U << UDRIE0);
    } else {
        UDR0 = oldest(&sending[0]);
    }
}

ISR(USART1_UDRE_vect)
{
    if (filled(&sending[1]) == 0U) {
        UCSR1B &= (uint8_t)~(1U << UDRIE1);
    } else {
        UDR1 = oldest(&sending[1]);
    }
}

uint8_t uart_waiting(uint8_t port)
{
    return filled(&received[port]);
}

uint8_t uart_take(uint8_t port)
{
    return oldest(&received[port]);
}

void uart_send(uint8_t port, const uint8_t *bytes, uint8_t count)
{
    struct ring *ring = &sending[port];
    const uint8_t room = (uint8_t)(RING - 1U - filled(ring));
    if (count > room) {
        return;
    }
    uint8_t head = ring->head;
    for (uint8_t i = 0; i < count; i++) {
        ring->bytes[head] = bytes[i];
        head = (uint8_t)(head + 1U);
    }
    ring->head = head;
    if (port == 0U) {
        UCSR0B |= (uint8_t)(1U << UDRIE0);
    } else {
        UCSR1B |= (uint8_t)(1U << UDRIE1);
    }
}
