/* Runs judged.elf on simavr: steps on the standard input, answers on the standard output.
 *   harness judged.elf MAILBOX FIRMWARE STACK   (addresses in RAM, and the end of what is linked)
 * An answer is what the chip answered, the cycles of receiving, of the period and of sending, and
 * the most bytes of stack so far. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <simavr/avr_ioport.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

enum {
    GPIOR0 = 0x3E,
    GPIOR1 = 0x4A,
    HEAD = 26,
    DATA = 26,
    BATCH = 250,
    REPLIED = DATA + BATCH,
    REPLIES = 600,
    TOLD = REPLIED + 2 + REPLIES,
    TOLD_SIZE = 1 + 34 + 4,
    REGISTERS = 130,
    RAM = 0x4100,
    PAINT = 0xA5,
    PATIENCE = 100000000
};

static uint64_t marks[5];

static void mark(struct avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = value;
    if (value < 5U) {
        marks[value] = avr->cycle;
    }
}

static void go(avr_t *avr)
{
    const uint64_t until = avr->cycle + PATIENCE;
    while (avr->data[GPIOR0] == 0U) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed || avr->cycle > until) {
            (void)fprintf(stderr, "harness: the chip stopped, state %d\n", state);
            exit(1);
        }
    }
}

int main(int count, char *words[])
{
    FILE *answers = fdopen(dup(STDOUT_FILENO), "wb"); /* simavr talks on the standard output */
    elf_firmware_t elf;
    (void)memset(&elf, 0, sizeof(elf));
    if (answers == NULL || freopen("/dev/null", "w", stdout) == NULL) {
        return 1;
    }
    if (count != 5 || elf_read_firmware(words[1], &elf) != 0) {
        (void)fprintf(stderr, "harness: judged.elf MAILBOX FIRMWARE STACK\n");
        return 2;
    }
    const unsigned long mailbox = strtoul(words[2], NULL, 16) & 0xFFFFU;
    const unsigned long firmware = strtoul(words[3], NULL, 16) & 0xFFFFU;
    const unsigned long linked = strtoul(words[4], NULL, 16) & 0xFFFFU;
    avr_t *avr = avr_make_mcu_by_name("atmega1284p");
    if (avr == NULL || avr_init(avr) != 0) {
        return 1;
    }
    avr->frequency = 20000000;
    avr_load_firmware(avr, &elf);
    avr_register_io_write(avr, GPIOR1, mark, NULL);
    (void)memset(&avr->data[linked], PAINT, RAM - linked);
    go(avr);
    uint8_t head[HEAD];
    uint8_t data[BATCH];
    unsigned long lowest = RAM;
    while (fread(head, 1, HEAD, stdin) == HEAD) {
        const unsigned size = (unsigned)head[24] | ((unsigned)head[25] << 8);
        if (size > BATCH || fread(data, 1, size, stdin) != size) {
            (void)fprintf(stderr, "harness: a step has more than %d bytes\n", BATCH);
            return 2;
        }
        (void)memcpy(&avr->data[mailbox], head, HEAD);
        (void)memcpy(&avr->data[mailbox + DATA], data, size);
        avr->data[GPIOR0] = 0;
        go(avr);
        unsigned long at = linked;
        while (at < lowest && avr->data[at] == PAINT) {
            at++;
        }
        lowest = at;
        const uint32_t told[4] = {
            (uint32_t)(marks[2] - marks[1]), (uint32_t)(marks[3] - marks[2]),
            (uint32_t)(marks[4] - marks[3]), (uint32_t)(RAM - lowest)};
        const uint8_t *box = &avr->data[mailbox];
        const size_t replied = (size_t)(box[REPLIED] | (box[REPLIED + 1] << 8));
        (void)fwrite(&box[REPLIED], 1, 2 + replied, answers);
        (void)fwrite(&box[TOLD], 1, TOLD_SIZE, answers);
        (void)fwrite(&avr->data[firmware], 1, REGISTERS, answers);
        (void)fwrite(told, sizeof(told[0]), 4, answers);
        (void)fflush(answers);
    }
    return 0;
}
