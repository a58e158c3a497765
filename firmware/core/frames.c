#include "frames.h"

#include <string.h>

#define START ((uint8_t)'#')
#define ADDRESS ((uint8_t)'b')
#define FIRST ((uint8_t)'=') /* of the 64 characters of data64 */
#define FRAME_MIN 5U         /* `#`, address, command and checksum */

void decoder_begin(struct decoder *d)
{
    (void)memset(d, 0, sizeof(*d));
}

static uint16_t sum_of(const uint8_t *bytes, uint8_t count)
{
    uint16_t sum = 0;
    for (uint8_t i = 0; i < count; i++) {
        sum = (uint16_t)(sum + bytes[i]);
    }
    return sum & 0x0FFFU;
}

static bool decode(const uint8_t *bytes, uint8_t count, struct frame *frame)
{
    const uint8_t end = (uint8_t)(count - 2U);
    const uint16_t sum = sum_of(bytes, end);
    if ((bytes[end] != (uint8_t)(FIRST + (sum >> 6))) ||
        (bytes[end + 1U] != (uint8_t)(FIRST + (sum & 63U))) || (((end - 3U) & 3U) != 0U)) {
        return false;
    }
    frame->address = bytes[1];
    frame->command = bytes[2];
    frame->size = 0;
    for (uint8_t i = 3; i < end; i = (uint8_t)(i + 4U)) {
        uint8_t six[4];
        for (uint8_t k = 0; k < 4U; k++) {
            six[k] = (uint8_t)(bytes[i + k] - FIRST);
            if (six[k] > 63U) {
                return false;
            }
        }
        uint8_t *three = &frame->payload[frame->size];
        three[0] = (uint8_t)((six[0] << 2) | (six[1] >> 4));
        three[1] = (uint8_t)((six[1] << 4) | (six[2] >> 2));
        three[2] = (uint8_t)((six[2] << 6) | six[3]);
        frame->size = (uint8_t)(frame->size + 3U);
    }
    return true;
}

bool decoder_end(struct decoder *d, struct frame *frame)
{
    if (d->noisy) {
        d->damaged++;
    }
    const bool fits = (d->since >= FRAME_MIN) && (d->since <= FRAME_MAX);
    const bool found = fits && decode(d->kept, d->since, frame);
    if (!found) {
        d->damaged++;
    }
    d->since = 0;
    d->length = 0;
    d->noisy = false;
    return found;
}

void decoder_keep(struct decoder *d, uint8_t byte)
{
    if (byte == START) {
        d->noisy = d->length > 0U;
        d->since = 0;
    }
    if ((byte == START) || (d->since > 0U)) {
        if (d->since < FRAME_MAX) {
            d->kept[d->since] = byte;
        }
        if (d->since <= FRAME_MAX) {
            d->since++;
        }
    }
    if (d->length <= FRAME_MAX) {
        d->length++;
    }
}

void decoder_settle(struct decoder *d)
{
    if (d->length > FRAME_MAX) {
        d->damaged++;
        if (d->since > FRAME_MAX) {
            d->since = FRAME_MAX;
        }
        d->length = d->since;
        d->noisy = false;
    }
}

uint8_t encode_frame(uint8_t command, const uint8_t *payload, uint8_t size, uint8_t *out)
{
    uint8_t at = 3;
    out[0] = START;
    out[1] = ADDRESS;
    out[2] = command;
    for (uint8_t i = 0; i < size; i = (uint8_t)(i + 3U)) {
        const uint8_t *three = &payload[i];
        out[at] = (uint8_t)(FIRST + (three[0] >> 2));
        out[at + 1U] = (uint8_t)(FIRST + ((uint8_t)((three[0] << 4) | (three[1] >> 4)) & 63U));
        out[at + 2U] = (uint8_t)(FIRST + ((uint8_t)((three[1] << 2) | (three[2] >> 6)) & 63U));
        out[at + 3U] = (uint8_t)(FIRST + (three[2] & 63U));
        at = (uint8_t)(at + 4U);
    }
    const uint16_t sum = sum_of(out, at);
    out[at] = (uint8_t)(FIRST + (sum >> 6));
    out[at + 1U] = (uint8_t)(FIRST + (sum & 63U));
    out[at + 2U] = FRAME_END;
    return (uint8_t)(at + 3U);
}
