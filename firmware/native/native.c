/* The firmware as a shared object for this computer: whole batches of bytes, and what it drives. */
#include <stddef.h>
#include <string.h>

#include "firmware.h"

size_t native_size(void);
void native_begin(struct firmware *f, uint8_t ports);
size_t native_receive(struct firmware *f, uint8_t port, const uint8_t *data, size_t count,
                      uint8_t *replies);
void native_set_period(struct firmware *f, uint16_t sixteenths);
void native_set_missing(struct firmware *f, uint8_t motors);
void native_steps(struct firmware *f, uint32_t ms, uint8_t count, uint8_t step_ms);
void native_driven(const struct firmware *f, uint8_t out[2U * MOTORS]);

size_t native_size(void)
{
    return sizeof(struct firmware);
}

void native_begin(struct firmware *f, uint8_t ports)
{
    firmware_begin(f, ports);
}

/* Take a batch of bytes; `replies` has room for twice as many and DATA_FRAME more. */
size_t native_receive(struct firmware *f, uint8_t port, const uint8_t *data, size_t count,
                      uint8_t *replies)
{
    size_t at = 0;
    for (size_t i = 0; i < count; i++) {
        at += firmware_take(f, port, data[i], &replies[at]);
    }
    firmware_settle(f, port);
    return at;
}

void native_set_period(struct firmware *f, uint16_t sixteenths)
{
    program_set_period(&f->program, sixteenths);
}

void native_set_missing(struct firmware *f, uint8_t motors)
{
    f->program.missing = motors;
}

void native_steps(struct firmware *f, uint32_t ms, uint8_t count, uint8_t step_ms)
{
    statistics_steps(&f->statistics, f->registers, ms, count, step_ms);
}

/* Tell the four motor references, then the four bytes of the newest command. */
void native_driven(const struct firmware *f, uint8_t out[2U * MOTORS])
{
    (void)memcpy(out, f->program.references, MOTORS);
    (void)memcpy(&out[MOTORS], f->command, MOTORS);
}
