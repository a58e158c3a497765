/* The microcontroller's own statistics, updated each second. */
#ifndef STATISTICS_H
#define STATISTICS_H

#include <stdint.h>

struct statistics {
    uint32_t began_ms, command_ms, packet_ms;
    uint32_t commands, packets, second_packets, steps;
    uint32_t command_gap, packet_gap, longest_step;
};

/* Count a frame that carried a command. */
void statistics_command(struct statistics *s, uint32_t ms);

/* Count a `D` frame that was sent on this port. */
void statistics_packet(struct statistics *s, uint8_t port, uint32_t ms);

/* Count periods of at most step_ms; write the registers once a second. */
void statistics_steps(struct statistics *s, int16_t *registers, uint32_t ms, uint8_t count,
                      uint8_t step_ms);

#endif
