#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#define CYCLES_PER_US (F_CPU / 1000000UL)
#define SCAN 17000U /* cycles before a period that its readings begin: 8 of 13 * 128, 12 * 128 once */

static volatile uint8_t begun;

ISR(TIMER1_COMPA_vect)
{
    begun++;
}

void clock_set_period(uint16_t period_us)
{
    const uint16_t top = (uint16_t)((period_us * CYCLES_PER_US) - 1U);
    cli();
    OCR1A = top;
    OCR1B = (uint16_t)(top - SCAN);
    TCNT1 = 0; /* a new period, with readings: those of this one may be due no more, or again */
    sei();
}

void clock_begin(void)
{
    TIMSK1 = (1U << OCIE1A) | (1U << OCIE1B);
    TCCR1B = (1U << WGM12) | (1U << CS10); /* from 0 to OCR1A, each cycle */
}

uint8_t clock_wait(void)
{
    SMCR = (1U << SE); /* idle: the clocks of timer, lines and bus go on */
    for (;;) {
        cli();
        const uint8_t count = begun;
        if (count != 0U) {
            begun = 0;
            sei();
            return count;
        }
        sei(); /* takes effect after the next instruction: no interrupt is slept through */
        sleep_cpu();
        __asm__ volatile("nop"); /* simavr serves what was pending one instruction late */
    }
}
