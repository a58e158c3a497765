#include "converters.h"

#include <avr/interrupt.h>
#include <avr/io.h>

/* Inertial sensors last: these are the freshest when the period begins. */
static const uint8_t order[CHANNELS] = {
    CHANNEL_BATTERY, CHANNEL_PRESSURE, CHANNEL_ACCELEROMETER_X, CHANNEL_ACCELEROMETER_Y,
    CHANNEL_ACCELEROMETER_Z, CHANNEL_GYROSCOPE_Z, CHANNEL_GYROSCOPE_X, CHANNEL_GYROSCOPE_Y};

static volatile int16_t newest[CHANNELS];
static volatile uint8_t turn;

/* 156 kHz, within the 200 kHz of full resolution; the reference is external. */
#define START ((1U << ADEN) | (1U << ADSC) | (1U << ADIE) | (1U << ADPS2) | (1U << ADPS1) | (1U << ADPS0))

void converters_begin(void)
{
    DIDR0 = 0xFF; /* no digital inputs on these pins */
    for (uint8_t i = 0; i < CHANNELS; i++) {
        newest[i] = (i == CHANNEL_PRESSURE || i == CHANNEL_BATTERY) ? 0 : 512;
    }
}

ISR(TIMER1_COMPB_vect)
{
    turn = 0;
    ADCSRA = 0; /* gives up what another period began */
    ADMUX = order[0];
    ADCSRA = START;
}

ISR(ADC_vect)
{
    const uint8_t next = (uint8_t)(turn + 1U);
    newest[order[turn]] = (int16_t)ADC;
    if (next < CHANNELS) {
        turn = next;
        ADMUX = order[next];
        ADCSRA = START;
    }
}

void converters_read(int16_t counts[CHANNELS])
{
    cli();
    for (uint8_t i = 0; i < CHANNELS; i++) {
        counts[i] = newest[i];
    }
    sei();
}
