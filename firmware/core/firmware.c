#include "firmware.h"

#include <string.h>

#include "fixed.h"

#define ADDRESS ((uint8_t)'b')
#define COMMAND_PAYLOAD 6U
#define SET_PAYLOAD 9U
#define REQUEST_PAYLOAD 6U
#define MIRROR_PAYLOAD 15U

/* Motor states from which each may be set, as bits: off from all (the cut), and only off from
 * emergency. */
static const uint8_t allowed[4] = {
    (1U << STATE_INIT) | (1U << STATE_OFF),
    (1U << STATE_ON) | (1U << STATE_INIT) | (1U << STATE_OFF),
    (1U << STATE_EMERGENCY) | (1U << STATE_ON),
    0x0F,
};

/* Put an int16 into two bytes, the low one first. */
static void put(uint8_t *out, int16_t value)
{
    out[0] = (uint8_t)((uint16_t)value & 0xFFU);
    out[1] = (uint8_t)((uint16_t)value >> 8);
}

static int16_t int16_at(const uint8_t *bytes)
{
    return (int16_t)(uint16_t)(bytes[0] | (uint16_t)((uint16_t)bytes[1] << 8));
}

void firmware_begin(struct firmware *f, uint8_t ports)
{
    static const uint8_t mirror[MIRRORED] = DEFAULT_MIRROR;
    (void)memset(f, 0, sizeof(*f));
    program_begin(&f->program);
    f->ports = ports;
    f->time_ms = (uint16_t)START_MS;
    (void)memcpy(f->mirror, mirror, sizeof(mirror));
    int16_t *r = f->registers;
    r[ID_ROBOT_ID] = ROBOT_ID;
    r[ID_FIRMWARE_REVISION] = FIRMWARE_REVISION;
    r[ID_FLIGHT_CONTROL_MODE] = MODE_NEAR_HOVERING;
    r[ID_MIRROR_ACTIVE] = 1;
    r[ID_DRIFT_ESTIMATION_ACTIVE] = 1;
    r[ID_SECOND_SERIAL_ENABLED] = (ports > 1U) ? 1 : 0;
    r[ID_EMERGENCY_TIMEOUT] = COMMAND_TIMEOUT_MS;
    r[ID_EMERGENCY_THRUST] = EMERGENCY_THRUST;
    r[ID_GAIN_P] = DEFAULT_GAIN_P;
    r[ID_GAIN_D] = DEFAULT_GAIN_D;
    r[ID_GAIN_I] = DEFAULT_GAIN_I;
    r[ID_GAIN_YAW_RATE] = DEFAULT_GAIN_YAW_RATE;
    r[ID_GAIN_YAW_ACCELERATION] = DEFAULT_GAIN_YAW_ACCELERATION;
}

static void enter(struct firmware *f, uint8_t state)
{
    if (state == f->state) {
        return;
    }
    f->state = state;
    f->registers[ID_MOTOR_STATE] = state;
    f->charged_ms = f->ms;
    f->heard_ms = f->ms;
    f->emergency_ms = f->ms;
    (void)memset(f->command, 0, sizeof(f->command));
    f->program.landed = false;
}

static void set_motor_state(struct firmware *f, int16_t value)
{
    if ((value < 0) || (value > STATE_OFF) || !is_set(allowed[value], f->state)) {
        return;
    }
    if ((value == STATE_ON) && (f->program.missing != 0U)) {
        return; /* the motors do not start with a controller missing; ids 61 to 64 show which */
    }
    enter(f, (uint8_t)value);
}

/* Whether an id may be set besides the motor state, to this value. */
static bool writable(int16_t id, int16_t value)
{
    switch (id) {
    case ID_FLIGHT_CONTROL_MODE:
        return (value == 0) || (value == 1);
    case ID_EMERGENCY_TIMEOUT:
        return (value >= 50) && (value <= 5000);
    case ID_EMERGENCY_THRUST:
        return (value >= 28) && (value <= 110);
    case ID_MIRROR_PERIOD:
        return (value >= 1000) && (value <= 20000);
    case ID_DRIFT_ESTIMATION_ACTIVE:
    case ID_PORT_PIN:
        return true;
    default:
        return ((id >= ID_ACCELEROMETER_OFFSET_X) && (id <= ID_ACCELEROMETER_OFFSET_Z)) ||
               ((id >= ID_GAIN_P) && (id <= ID_YAW_CONTROL_TYPE)) ||
               ((id >= ID_CONTROL_PERIOD_MIN) && (id <= ID_IMU_PERIOD_MIN));
    }
}

static void take_command(struct firmware *f, const uint8_t *bytes)
{
    if (f->state == (uint8_t)STATE_ON) {
        (void)memcpy(f->command, bytes, MOTORS);
    }
}

static uint8_t tell_value(const struct firmware *f, int16_t id, uint8_t *reply)
{
    uint8_t payload[6] = {0};
    if ((id < 0) || (id >= REGISTERS)) {
        return 0;
    }
    put(payload, id);
    put(&payload[2], f->registers[id]);
    return encode_frame((uint8_t)'S', payload, sizeof(payload), reply);
}

static uint8_t set_value(struct firmware *f, const uint8_t *payload, uint8_t *reply)
{
    const int16_t id = int16_at(&payload[4]);
    const int16_t value = int16_at(&payload[6]);
    if (id == ID_MOTOR_STATE) {
        set_motor_state(f, value);
    } else if ((f->state != (uint8_t)STATE_EMERGENCY) && writable(id, value)) {
        f->registers[id] = value;
    } else {
        /* echoed with its present value */
    }
    take_command(f, payload);
    return tell_value(f, id, reply);
}

static uint8_t set_mirror(struct firmware *f, const uint8_t *ids, uint8_t *reply)
{
    uint8_t payload[12] = {0};
    bool known = true;
    for (uint8_t i = 0; i < MIRRORED; i++) {
        known = known && (ids[i] < REGISTERS);
    }
    if (known) {
        (void)memcpy(f->mirror, ids, MIRRORED);
    }
    (void)memcpy(payload, f->mirror, MIRRORED);
    return encode_frame((uint8_t)'L', payload, sizeof(payload), reply);
}

static uint8_t obey(struct firmware *f, const struct frame *frame, uint8_t *reply)
{
    const uint8_t kind = frame->command;
    const uint8_t size = frame->size;
    const bool sets = (kind == (uint8_t)'s') && (size == SET_PAYLOAD);
    const bool mirrors = (kind == (uint8_t)'l') && (size == MIRROR_PAYLOAD);
    const bool requests = (kind == (uint8_t)'u') && (size == REQUEST_PAYLOAD);
    const bool commands = (kind == (uint8_t)'b') && (size == COMMAND_PAYLOAD);
    if ((frame->address != ADDRESS) || !(sets || mirrors || requests || commands)) {
        return 0;
    }
    f->heard_ms = f->ms;
    statistics_command(&f->statistics, f->ms);
    if (sets) {
        return set_value(f, frame->payload, reply);
    }
    take_command(f, frame->payload);
    if (requests) {
        return tell_value(f, int16_at(&frame->payload[4]), reply);
    }
    return mirrors ? set_mirror(f, &frame->payload[4], reply) : 0U;
}

/* Apart from the rest, as most bytes end no frame and need no room for one. */
static __attribute__((noinline)) uint8_t answer(struct firmware *f, uint8_t port, uint8_t *reply)
{
    struct frame frame;
    return decoder_end(&f->decoders[port], &frame) ? obey(f, &frame, reply) : 0U;
}

uint8_t firmware_take(struct firmware *f, uint8_t port, uint8_t byte, uint8_t *reply)
{
    if (byte == FRAME_END) {
        return answer(f, port, reply);
    }
    decoder_keep(&f->decoders[port], byte);
    return 0;
}

void firmware_settle(struct firmware *f, uint8_t port)
{
    struct decoder *d = &f->decoders[port];
    decoder_settle(d);
    f->registers[ID_CRC_ERRORS] =
        (int16_t)(uint16_t)((uint16_t)f->registers[ID_CRC_ERRORS] + d->damaged);
    d->damaged = 0;
}

void firmware_advance(struct firmware *f, uint32_t elapsed_ms)
{
    const uint32_t time_ms = f->time_ms + (elapsed_ms - f->ms);
    f->time_ms = (uint16_t)((time_ms < (uint32_t)TIME_PERIOD_MS) ? time_ms
                                                                 : (time_ms % (uint32_t)TIME_PERIOD_MS));
    f->ms = elapsed_ms;
    if (f->state == (uint8_t)STATE_ON) {
        if (f->registers[ID_BATTERY] > BATTERY_LAND) {
            f->charged_ms = elapsed_ms;
        }
        const uint32_t silence = elapsed_ms - f->heard_ms;
        if ((silence > (uint16_t)f->registers[ID_EMERGENCY_TIMEOUT]) ||
            ((elapsed_ms - f->charged_ms) > BATTERY_TIME_MS)) {
            enter(f, (uint8_t)STATE_EMERGENCY);
        }
    } else if ((f->state == (uint8_t)STATE_EMERGENCY) &&
               (f->program.landed ||
                ((elapsed_ms - f->emergency_ms) > (uint32_t)LONGEST_LANDING_MS))) {
        enter(f, (uint8_t)STATE_OFF);
    } else {
        /* with the motors off nothing is missed */
    }
}

void firmware_period(struct firmware *f, const uint8_t command[MOTORS])
{
    program_run(&f->program, f->registers, command);
}

uint8_t firmware_data(struct firmware *f, uint8_t frame[DATA_FRAME])
{
    uint8_t payload[21] = {0};
    const uint8_t port = f->turn;
    f->turn = (uint8_t)((port + 1U) % f->ports);
    f->registers[ID_TIME] = (int16_t)f->time_ms;
    statistics_packet(&f->statistics, port, f->ms);
    for (uint8_t i = 0; i < MIRRORED; i++) {
        put(&payload[2U * i], f->registers[f->mirror[i]]);
    }
    (void)encode_frame((uint8_t)'D', payload, sizeof(payload), frame);
    return port;
}
