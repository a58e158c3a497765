/* Runs image.elf on simavr: its bytes come and go by its serial lines, its readings by the
 * converter's inputs, its motors' references by the bus, where this program answers.
 *   harness image.elf STACK   (the end in RAM of what is linked)
 * Standard input, for each period of the chip: counts of the 8 channels (uint16) from its begin on,
 * which the next period reads, the bits of the motor controllers that are silent (uint8; bit 7: stop
 * the period's timer), and for each line a count (uint8) and bytes that begin to arrive. Standard
 * output, when the period's work has ended: what it began with (uint8: bits of missing motors, and
 * 16 for each period that passed; bit 7), the bytes that it took of each line (uint8 each), what the
 * bus carried last to each motor, cycles awake and cycles in all since the last answer, the most
 * bytes of stack so far (uint32 each), and for each line a count (uint8) and bytes that left. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_io.h>

enum {
    GPIOR0 = 0x3E,
    GPIOR1 = 0x4A,
    GPIOR2 = 0x4B,
    TIMSK1 = 0x6F,
    PORTS = 2,
    MOTORS = 4,
    CHANNELS = 8,
    AREF_MV = 3000,
    COUNTS = 1023,
    BYTE_CYCLES = 11 * 16 * 11, /* simavr's lines carry 11 bits a byte */
    QUEUE = 1 << 16,
    SENT = 255,
    RAM = 0x4100,
    PAINT = 0xA5,
    PATIENCE = 2000000, /* cycles of a period, and of a watchdog's reset */
    STOP_TIMER = 0x80
};

struct line {
    avr_irq_t *in;
    uint8_t queue[QUEUE];
    unsigned head, tail;
    uint8_t sent[SENT];
    unsigned count;
};

static avr_t *avr;
static struct line lines[PORTS];
static avr_irq_t *bus;
static const uint8_t addresses[MOTORS] = {0x52, 0x58, 0x54, 0x56};
static uint8_t silent, began, driven[MOTORS], taken[PORTS];
static uint16_t counts[CHANNELS];
static bool ended;

static void refuse(const char *why)
{
    (void)fprintf(stderr, "harness: %s\n", why);
    exit(1);
}

static void turn_inputs(void)
{
    for (unsigned i = 0; i < CHANNELS; i++) {
        const uint32_t mv = (counts[i] * (uint32_t)AREF_MV + COUNTS - 1) / COUNTS;
        avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, (int)(ADC_IRQ_ADC0 + i)), mv);
    }
}

static void mark(avr_t *chip, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    chip->data[address] = value;
    if (address == GPIOR0) {
        ended = value == 0U;
        if (!ended) {
            began = value;
            turn_inputs();
        }
    } else {
        taken[address - GPIOR1] = value;
    }
}

static void left(struct avr_irq_t *irq, uint32_t value, void *param)
{
    struct line *line = param;
    (void)irq;
    if (line->count == SENT) {
        refuse("a line sent too much in a period");
    }
    line->sent[line->count] = (uint8_t)value;
    line->count++;
}

/* Let the next byte of a line arrive, once the chip listens. */
static avr_cycle_count_t arrive(avr_t *chip, avr_cycle_count_t when, void *param)
{
    struct line *line = param;
    (void)chip;
    if (began != 0U && line->tail != line->head) {
        avr_raise_irq(line->in, line->queue[line->tail % QUEUE]);
        line->tail++;
    }
    return when + BYTE_CYCLES;
}

/* Answer on the bus as motor controllers do. */
static void on_bus(struct avr_irq_t *irq, uint32_t value, void *param)
{
    avr_twi_msg_irq_t told = {.u = {.v = value}};
    (void)irq;
    (void)param;
    for (unsigned i = 0; i < MOTORS; i++) {
        const bool addressed = told.u.twi.addr == addresses[i] && (silent & (1U << i)) == 0U;
        if (addressed && (told.u.twi.msg & (TWI_COND_START | TWI_COND_WRITE)) != 0U) {
            if ((told.u.twi.msg & TWI_COND_WRITE) != 0U) {
                driven[i] = told.u.twi.data;
            }
            avr_raise_irq(bus + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_ACK, addresses[i], 1));
        }
    }
}

/* Simulated time need not pass in real time. */
static void sleep_at_once(avr_t *chip, avr_cycle_count_t cycles)
{
    (void)chip;
    (void)cycles;
}

static void connect(void)
{
    for (unsigned i = 0; i < PORTS; i++) {
        uint32_t flags = 0;
        const char name = (char)('0' + i);
        (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS(name), &flags);
        lines[i].in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_INPUT);
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(name), UART_IRQ_OUTPUT),
                                left, &lines[i]);
    }
    bus = avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT);
    avr_irq_register_notify(bus + TWI_IRQ_OUTPUT, on_bus, NULL);
    avr_register_io_write(avr, GPIOR0, mark, NULL);
    avr_register_io_write(avr, GPIOR1, mark, NULL);
    avr_register_io_write(avr, GPIOR2, mark, NULL);
}

static bool take_input(void)
{
    uint8_t data[SENT];
    if (fread(counts, sizeof(counts), 1, stdin) != 1 || fread(&silent, 1, 1, stdin) != 1) {
        return false;
    }
    if (began == 0U) {
        turn_inputs(); /* before the first period */
    }
    if ((silent & STOP_TIMER) != 0U) {
        avr->data[TIMSK1] = 0;
    }
    for (unsigned i = 0; i < PORTS; i++) {
        uint8_t count = 0;
        struct line *line = &lines[i];
        if (avr_cycle_timer_status(avr, arrive, line) == 0U) { /* at first, and after a reset */
            avr_cycle_timer_register(avr, BYTE_CYCLES, arrive, line);
        }
        if (fread(&count, 1, 1, stdin) != 1 || fread(data, 1, count, stdin) != count) {
            return false;
        }
        for (unsigned k = 0; k < count; k++) {
            line->queue[line->head % QUEUE] = data[k];
            line->head++;
        }
        if (line->head - line->tail > QUEUE) {
            refuse("more bytes than a line carries");
        }
    }
    return true;
}

/* Run to the end of a period's work; return the cycles awake. */
static uint32_t run_period(void)
{
    const avr_cycle_count_t begun = avr->cycle;
    uint32_t awake = 0;
    ended = false;
    while (!ended) {
        const avr_cycle_count_t before = avr->cycle;
        const bool sleeping = avr->state == cpu_Sleeping;
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed || avr->cycle - begun > PATIENCE) {
            refuse("the chip stopped");
        }
        if (!sleeping && state != cpu_Sleeping) {
            awake += (uint32_t)(avr->cycle - before);
        }
    }
    return awake;
}

int main(int count, char *words[])
{
    FILE *answers = fdopen(dup(STDOUT_FILENO), "wb"); /* simavr talks on the standard output */
    elf_firmware_t elf;
    (void)memset(&elf, 0, sizeof(elf));
    if (answers == NULL || freopen("/dev/null", "w", stdout) == NULL) {
        return 1;
    }
    if (count != 3 || elf_read_firmware(words[1], &elf) != 0) {
        refuse("image.elf STACK");
    }
    const unsigned long linked = strtoul(words[2], NULL, 16) & 0xFFFFU;
    avr = avr_make_mcu_by_name("atmega1284p");
    if (avr == NULL || avr_init(avr) != 0) {
        return 1;
    }
    avr->frequency = 20000000;
    avr->vcc = avr->avcc = 5000;
    avr->aref = AREF_MV;
    avr->sleep = sleep_at_once;
    avr_load_firmware(avr, &elf);
    (void)memset(&avr->data[linked], PAINT, RAM - linked);
    connect();
    unsigned long lowest = RAM;
    avr_cycle_count_t answered = 0;
    while (take_input()) {
        uint32_t told[3] = {run_period(), (uint32_t)(avr->cycle - answered), 0};
        answered = avr->cycle;
        unsigned long at = linked;
        while (at < lowest && avr->data[at] == PAINT) {
            at++;
        }
        lowest = at;
        told[2] = (uint32_t)(RAM - lowest);
        (void)fwrite(&began, 1, 1, answers);
        (void)fwrite(taken, 1, PORTS, answers);
        (void)fwrite(driven, 1, MOTORS, answers);
        (void)fwrite(told, sizeof(told), 1, answers);
        for (unsigned i = 0; i < PORTS; i++) {
            const uint8_t sent = (uint8_t)lines[i].count;
            (void)fwrite(&sent, 1, 1, answers);
            (void)fwrite(lines[i].sent, 1, sent, answers);
            lines[i].count = 0;
        }
        (void)fflush(answers);
    }
    return 0;
}
