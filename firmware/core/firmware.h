/* The microcontroller's firmware: serial protocol, modes, and supervision of the onboard computer.
 * The board calls it: bytes in, frames out, sensors into registers, references to the motors. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include "constants.h"
#include "frames.h"
#include "program.h"
#include "statistics.h"

#define PORTS_MAX 2U
#define MIRRORED 10U

struct firmware {
    int16_t registers[REGISTERS];
    uint8_t command[MOTORS]; /* the newest, all 0 unless the motors are on */
    uint8_t ports, turn;     /* serial lines, and which sends the next `D` frame */
    uint8_t state;
    uint8_t mirror[MIRRORED];
    uint16_t time_ms; /* that is told: of a minute */
    uint32_t ms, heard_ms, charged_ms, emergency_ms;
    struct decoder decoders[PORTS_MAX];
    struct statistics statistics;
    struct program program;
};

void firmware_begin(struct firmware *f, uint8_t ports);

/* Take a byte of a line; write the reply to send on it, at most DATA_FRAME bytes; return its length. */
uint8_t firmware_take(struct firmware *f, uint8_t port, uint8_t byte, uint8_t *reply);

/* End a batch of bytes of a line. */
void firmware_settle(struct firmware *f, uint8_t port);

/* Set the time since power-up; check whether an emergency begins or ends. */
void firmware_advance(struct firmware *f, uint32_t elapsed_ms);

/* Run one period with the bytes of a command; sensors are in the registers. */
void firmware_period(struct firmware *f, const uint8_t command[MOTORS]);

/* Write the `D` frame of the present registers; return the port to send it on. */
uint8_t firmware_data(struct firmware *f, uint8_t frame[DATA_FRAME]);

#endif
