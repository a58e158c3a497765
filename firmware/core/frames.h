/* Bytes to frames and back: `#`, address, command, data64, two characters of checksum, `\r`. */
#ifndef FRAMES_H
#define FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#define FRAME_MAX 64U       /* bytes of the longest frame that is looked at, without its end */
#define PAYLOAD_MAX 45U
#define FRAME_END ((uint8_t)'\r')
#define DATA_FRAME 34U      /* bytes of a `D` frame, the longest that is sent */

/* One undamaged frame; the payload is zero padded to a multiple of 3 bytes. */
struct frame {
    uint8_t address, command, size;
    uint8_t payload[PAYLOAD_MAX];
};

/* Cuts one line's bytes into frames; keeps at most one unfinished frame. */
struct decoder {
    uint8_t since;           /* bytes from the last `#` on, FRAME_MAX + 1 at most; 0: there is none */
    uint8_t length;          /* bytes since the last end, FRAME_MAX + 1 at most */
    bool noisy;              /* bytes came before the last `#` */
    uint16_t damaged;        /* pieces between two ends that were no frame */
    uint8_t kept[FRAME_MAX]; /* from the last `#` on; last, as what is before is reached faster */
};

void decoder_begin(struct decoder *d);

/* Take a byte other than FRAME_END. */
void decoder_keep(struct decoder *d, uint8_t byte);

/* Take FRAME_END; return whether it ended an undamaged frame. */
bool decoder_end(struct decoder *d, struct frame *frame);

/* End a batch of bytes: forget what is too long to begin a frame. */
void decoder_settle(struct decoder *d);

/* Write one frame, of a payload of `size` bytes, a multiple of 3; return its length. */
uint8_t encode_frame(uint8_t command, const uint8_t *payload, uint8_t size, uint8_t *out);

#endif
