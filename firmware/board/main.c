/* The flight controller's image. It begins with the motors off, and drives them only after a
 * motor state that a serial line sets; it resets by its watchdog when a period does not end. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "clock.h"
#include "converters.h"
#include "firmware.h"
#include "fixed.h"
#include "motor_bus.h"
#include "pressure.h"
#include "uart.h"

#define PERIOD_MAX_US 2000U /* the chip has no time for 1 ms with full lines */
#define SAMPLE_US 2000     /* between two `D` frames, until it is set */
#ifndef PORTS
#define PORTS PORTS_MAX /* serial lines that are connected */
#endif

/* How time passes: a sample is a whole number of periods. */
struct pace {
    uint16_t sample_us, period_us;
    uint8_t period_ms;     /* rounded */
    uint8_t periods, left; /* of a sample; until the next is sent */
    uint32_t ms;           /* since power-up */
    uint16_t us;           /* and less than a millisecond */
};

static struct firmware firmware;
static struct pace pace;

/* Take the sample's period that was set last. */
static void set_pace(void)
{
    pace.sample_us = (uint16_t)firmware.registers[ID_MIRROR_PERIOD];
    pace.periods = (uint8_t)((pace.sample_us + PERIOD_MAX_US - 1U) / PERIOD_MAX_US);
    pace.period_us = (uint16_t)(pace.sample_us / pace.periods);
    pace.period_ms = (pace.period_us < 1500U) ? 1U : 2U;
    pace.left = pace.periods;
    program_set_period(&firmware.program, (uint16_t)(16U * pace.period_us));
    clock_set_period(pace.period_us);
}

static void pass(uint8_t periods)
{
    for (uint8_t i = 0; i < periods; i++) {
        pace.us = (uint16_t)(pace.us + pace.period_us);
        while (pace.us >= 1000U) { /* twice at most */
            pace.us = (uint16_t)(pace.us - 1000U);
            pace.ms++;
        }
    }
}

/* Take what a line brought, and answer; return how many bytes. */
static uint8_t listen(uint8_t port)
{
    uint8_t reply[DATA_FRAME];
    const uint8_t count = uart_waiting(port);
    for (uint8_t i = 0; i < count; i++) {
        const uint8_t size = firmware_take(&firmware, port, uart_take(port), reply);
        if (size > 0U) {
            uart_send(port, reply, size);
        }
    }
    if (count > 0U) {
        firmware_settle(&firmware, port);
    }
    return count;
}

static int16_t along(int16_t count, uint8_t turned)
{
    return (int16_t)((turned != 0U) ? (CONVERTER_MAX - count) : count);
}

static void sense(void)
{
    int16_t counts[CHANNELS];
    int16_t *r = firmware.registers;
    converters_read(counts);
    r[ID_ACCELEROMETER_X] = along(counts[CHANNEL_ACCELEROMETER_X], TURNED_ACCELEROMETER_X);
    r[ID_ACCELEROMETER_Y] = along(counts[CHANNEL_ACCELEROMETER_Y], TURNED_ACCELEROMETER_Y);
    r[ID_ACCELEROMETER_Z] = along(counts[CHANNEL_ACCELEROMETER_Z], TURNED_ACCELEROMETER_Z);
    r[ID_GYROSCOPE_X] = along(counts[CHANNEL_GYROSCOPE_X], TURNED_GYROSCOPE_X);
    r[ID_GYROSCOPE_Y] = along(counts[CHANNEL_GYROSCOPE_Y], TURNED_GYROSCOPE_Y);
    r[ID_GYROSCOPE_Z] = along(counts[CHANNEL_GYROSCOPE_Z], TURNED_GYROSCOPE_Z);
    r[ID_BATTERY] = narrow((product(counts[CHANNEL_BATTERY], BATTERY_FACTOR) + 0x2000) >> 14);
    r[ID_PRESSURE] = pressure_of(counts[CHANNEL_PRESSURE]);
    if ((firmware.state == (uint8_t)STATE_INIT) || (firmware.state == (uint8_t)STATE_OFF)) {
        pressure_find(counts[CHANNEL_PRESSURE], pace.ms);
    }
}

static void run_period(uint8_t begun)
{
    pass(begun);
    firmware.program.missing = motor_bus_missing();
    /* For who watches the chip: a period begins, and how many did. */
    GPIOR0 = (uint8_t)(0x80U | ((begun & 7U) << 4) | firmware.program.missing);
    firmware_advance(&firmware, pace.ms);
    GPIOR1 = listen(0);
    GPIOR2 = (PORTS > 1U) ? listen(1) : 0U;
    sense();
    firmware_period(&firmware, firmware.command);
    motor_bus_send(firmware.program.references);
    statistics_steps(&firmware.statistics, firmware.registers, pace.ms, begun,
                     (uint8_t)(begun * pace.period_ms));
    pace.left--;
    if (pace.left == 0U) {
        uint8_t frame[DATA_FRAME];
        pace.left = pace.periods;
        const uint8_t port = firmware_data(&firmware, frame);
        uart_send(port, frame, sizeof(frame));
    }
    if ((uint16_t)firmware.registers[ID_MIRROR_PERIOD] != pace.sample_us) {
        set_pace();
    }
    GPIOR0 = 0; /* it ended */
}

int main(void)
{
    MCUSR = 0; /* a watchdog that fired stays on, and its flag with it, until it is cleared */
    wdt_enable(WDTO_15MS);
    firmware_begin(&firmware, PORTS);
    firmware.registers[ID_MIRROR_PERIOD] = SAMPLE_US;
    uart_begin();
    converters_begin();
    pressure_begin();
    motor_bus_begin();
    set_pace();
    clock_begin();
    for (;;) {
        run_period(clock_wait());
        wdt_reset();
    }
}
