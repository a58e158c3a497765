#include "statistics.h"

#include <string.h>

#include "constants.h"

#define SECOND_MS 1000U

static uint32_t longer(uint32_t one, uint32_t other)
{
    return (one > other) ? one : other;
}

static int16_t shown(uint32_t value)
{
    return (int16_t)((value > (uint32_t)INT16_MAX) ? (uint32_t)INT16_MAX : value);
}

/* Return count / duration, rounded. As little more than a second has passed, it is less than count
 * by a quotient of 16 bits, where the chip's division costs a third. */
static int16_t a_second(uint32_t count, uint32_t duration_ms)
{
    const uint32_t excess = duration_ms - SECOND_MS;
    if ((count < SECOND_MS) && (excess < 16U)) {
        const uint16_t duration = (uint16_t)duration_ms;
        const uint16_t less = (uint16_t)(((2U * (uint16_t)count * (uint16_t)excess) + duration - 1U) /
                                         (uint16_t)(2U * duration));
        return (int16_t)((uint16_t)count - less);
    }
    return shown(((2U * SECOND_MS * count) + duration_ms) / (2U * duration_ms));
}

void statistics_command(struct statistics *s, uint32_t ms)
{
    s->commands++;
    s->command_gap = longer(s->command_gap, ms - s->command_ms);
    s->command_ms = ms;
}

void statistics_packet(struct statistics *s, uint8_t port, uint32_t ms)
{
    s->packets++;
    if (port == 1U) {
        s->second_packets++;
    }
    s->packet_gap = longer(s->packet_gap, ms - s->packet_ms);
    s->packet_ms = ms;
}

void statistics_steps(struct statistics *s, int16_t *registers, uint32_t ms, uint8_t count,
                      uint8_t step_ms)
{
    s->steps += count;
    s->longest_step = longer(s->longest_step, step_ms);
    const uint32_t duration = ms - s->began_ms;
    if (duration < SECOND_MS) {
        return;
    }
    /* A gap that has not ended counts with its length so far. */
    const uint32_t command_ms = s->command_ms;
    const uint32_t packet_ms = s->packet_ms;
    registers[ID_COMMANDS_PER_SECOND] = a_second(s->commands, duration);
    registers[ID_LONGEST_COMMAND_GAP] = shown(longer(s->command_gap, ms - command_ms));
    registers[ID_PACKETS_PER_SECOND] = a_second(s->packets, duration);
    registers[ID_LONGEST_PACKET_GAP] = shown(longer(s->packet_gap, ms - packet_ms));
    registers[ID_CONTROL_STEPS_PER_SECOND] = a_second(s->steps, duration);
    registers[ID_LONGEST_CONTROL_PERIOD] = shown(s->longest_step);
    registers[ID_ESTIMATION_STEPS_PER_SECOND] = registers[ID_CONTROL_STEPS_PER_SECOND];
    registers[ID_SECOND_SERIAL_PACKETS_PER_SECOND] = a_second(s->second_packets, duration);
    (void)memset(s, 0, sizeof(*s));
    s->began_ms = ms;
    s->command_ms = command_ms;
    s->packet_ms = packet_ms;
}
