/* The converter's readings of all channels, taken just before each period. */
#ifndef CONVERTERS_H
#define CONVERTERS_H

#include <stdint.h>

#include "wiring.h"

void converters_begin(void);

/* Copy the newest count of each channel, 0 to 1023. */
void converters_read(int16_t counts[CHANNELS]);

#endif
