#include "motor_bus.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>
#include <util/twi.h>

#include "wiring.h"

#define SILENT 5U /* transfers in a row without an answer: one lost to noise is none */

#define GO ((1U << TWINT) | (1U << TWEN) | (1U << TWIE))

static const uint8_t addresses[MOTORS] = MOTOR_ADDRESSES;

static volatile uint8_t out[MOTORS];
static volatile uint8_t silent[MOTORS];
static volatile uint8_t turn = MOTORS; /* the motor that is served; MOTORS: none */
static volatile bool addressed;        /* it answered to its address */

void motor_bus_begin(void)
{
    TWBR = BUS_DIVISOR;
    TWSR = 0;
    for (uint8_t i = 0; i < MOTORS; i++) {
        silent[i] = SILENT; /* missing until it answers */
    }
}

static void tell(uint8_t motor, bool answered)
{
    const uint8_t count = silent[motor];
    silent[motor] = answered ? 0U : ((count < SILENT) ? (uint8_t)(count + 1U) : SILENT);
}

/* End with a motor, and begin with the next or release the bus. */
static void next(bool answered)
{
    const uint8_t motor = turn;
    tell(motor, answered);
    turn = (uint8_t)(motor + 1U);
    TWCR = (turn < MOTORS) ? (GO | (1U << TWSTA)) : ((1U << TWINT) | (1U << TWEN) | (1U << TWSTO));
}

ISR(TWI_vect)
{
    const uint8_t motor = turn;
    if (motor >= MOTORS) {
        TWCR = 0;
        return;
    }
    switch (TW_STATUS) {
    case TW_START:
    case TW_REP_START:
        addressed = false;
        TWDR = addresses[motor];
        TWCR = GO;
        break;
    case TW_MT_SLA_ACK: /* simavr 1.6 gives the data's status for the address, too */
    case TW_MT_DATA_ACK:
        if (addressed) {
            next(true);
        } else {
            addressed = true;
            TWDR = out[motor];
            TWCR = GO;
        }
        break;
    case TW_MT_SLA_NACK:
    case TW_MT_DATA_NACK: /* it took the byte, and wants no more */
        next(addressed);
        break;
    default: /* lost arbitration or an error on the bus: all that is left waits for the next period */
        TWCR = 0;
        break;
    }
}

void motor_bus_send(const uint8_t references[MOTORS])
{
    cli();
    if (turn < MOTORS) { /* stuck, or slower than a period: the bus begins anew */
        TWCR = 0;
        for (uint8_t i = turn; i < MOTORS; i++) {
            tell(i, false);
        }
    }
    for (uint8_t i = 0; i < MOTORS; i++) {
        out[i] = references[i];
    }
    turn = 0;
    TWCR = GO | (1U << TWSTA);
    sei();
}

uint8_t motor_bus_missing(void)
{
    uint8_t missing = 0;
    for (uint8_t i = 0; i < MOTORS; i++) {
        if (silent[i] >= SILENT) {
            missing = (uint8_t)(missing | (1U << i));
        }
    }
    return missing;
}
