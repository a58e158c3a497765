/* The core alone on the chip, for `harness.c`: it fills the mailbox and clears `waiting`, and the
 * chip answers in the same place. No board: bytes and sensors are the harness's. */
#include <avr/io.h>
#include <avr/sleep.h>

#include "firmware.h"

#define BATCH 250U
#define REPLIES 600U

struct mailbox {
    uint16_t sixteenths;
    uint32_t ms;
    uint8_t port, missing;
    int16_t sensors[8];
    uint16_t count;
    uint8_t data[BATCH];
    uint16_t replied;
    uint8_t replies[REPLIES];
    uint8_t data_port, frame[DATA_FRAME], references[MOTORS];
} mailbox;

struct firmware firmware;

/* GPIOR0: 1 while the chip waits for the harness, 0 while it works; GPIOR1 counts the marks that
 * the harness takes the time at. */
int main(void)
{
    static const uint8_t sensors[8] = {
        ID_ACCELEROMETER_X, ID_ACCELEROMETER_Y, ID_ACCELEROMETER_Z, ID_GYROSCOPE_X,
        ID_GYROSCOPE_Y, ID_GYROSCOPE_Z, ID_BATTERY, ID_PRESSURE};
    firmware_begin(&firmware, PORTS_MAX);
    for (;;) {
        GPIOR0 = 1;
        while (GPIOR0 != 0U) {
        }
        program_set_period(&firmware.program, mailbox.sixteenths);
        firmware.program.missing = mailbox.missing;
        GPIOR1 = 1;
        firmware_advance(&firmware, mailbox.ms);
        mailbox.replied = 0;
        for (uint16_t i = 0; i < mailbox.count; i++) {
            mailbox.replied = (uint16_t)(mailbox.replied +
                firmware_take(&firmware, mailbox.port, mailbox.data[i],
                              &mailbox.replies[mailbox.replied]));
        }
        firmware_settle(&firmware, mailbox.port);
        GPIOR1 = 2;
        for (uint8_t i = 0; i < 8U; i++) {
            firmware.registers[sensors[i]] = mailbox.sensors[i];
        }
        firmware_period(&firmware, firmware.command);
        GPIOR1 = 3;
        statistics_steps(&firmware.statistics, firmware.registers, mailbox.ms, 1, 1);
        mailbox.data_port = firmware_data(&firmware, mailbox.frame);
        GPIOR1 = 4;
        for (uint8_t i = 0; i < MOTORS; i++) {
            mailbox.references[i] = firmware.program.references[i];
        }
    }
}
