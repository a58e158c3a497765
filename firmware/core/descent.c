/* The emergency descent: level, at a rate held by the barometer, motors off on the ground. */
#include "constants.h"
#include "fixed.h"
#include "program.h"

/* The specific force along z_B over what a thrust (2^-12 N) gives, 2^-12. */
static int32_t given(const struct program *p, int32_t thrust)
{
    const int32_t force = (p->force_b[2] > 0) ? p->force_b[2] : 0;
    const int32_t out = (force * SUPPORT_UNIT) / thrust;
    return (out > SUPPORT_MAX) ? SUPPORT_MAX : out;
}

/* The thrust of the motors' references, 2^-24 N. */
static int32_t commanded(const struct program *p)
{
    int32_t total = 0;
    for (uint8_t i = 0; i < MOTORS; i++) {
        if (p->references[i] > 0U) {
            const uint16_t speed = (uint16_t)(((uint16_t)p->references[i] << 7) + MOTOR_OFFSET);
            const uint16_t square = (uint16_t)(((uint32_t)speed * speed) >> 16);
            total += ((int32_t)square * (int16_t)MOTOR_SQUARE) >> 12;
        }
    }
    return up(total, 12);
}

void watch_thrust(struct program *p)
{
    p->commanded = commanded(p);
    p->thrust += by16(p->commanded - p->thrust, p->gains.thrust);
    const bool slow = p->landing && (climb_rate(p) > SETTLING_CLIMB);
    if ((p->thrust > STANDING) && (p->unloaded == 0) && !slow) {
        const int32_t found = up(given(p, p->thrust >> 12), 16);
        p->support += by16(found - p->support, p->gains.support);
    }
}

void begin_descent(struct program *p)
{
    p->landing = true;
    p->landed = false;
    p->carried = 0;
    p->faster = 0;
    p->lasted = 0;
    const int32_t carrying = (p->commanded < WEIGHT) ? p->commanded : WEIGHT; /* more than its average at lift-off */
    p->lift = (p->thrust > carrying) ? p->thrust : carrying;
    p->sink = -climb_rate(p);
    p->unloaded = 0;
    p->shown = up(p->force_b[2], 16);
    p->pulling = p->commanded;
    p->struck = BLOW_LASTS;
    p->try_at = 0;
    p->longest = SPARE + up(by16(within(p->height - p->ground, 0, HIGHEST), narrow(SLOWNESS)), 3);
    p->integral[0] = 0;
    p->integral[1] = 0;
    if (p->thrust < ((p->commanded < STANDING) ? STANDING : STARTING)) {
        stop_motors(p);
    }
}

/* The specific force that the thrust gives in the air, 2^-16 count. */
static int32_t pull_of(const struct program *p)
{
    return up(by16(by16(p->pulling, narrow(PULL)), narrow(p->support >> 16)), 4);
}

/* Presume the ground where it seems to carry the vehicle, or has hit it, and begin to test it. */
static void presume_ground(struct program *p, int32_t climb)
{
    const int16_t second = p->gains.second;
    const int32_t mean = p->pulling >> 12;
    const int32_t force = given(p, (mean > LEAST_WEIGHT) ? mean : LEAST_WEIGHT);
    const int32_t learnt = product(narrow(p->support >> 16), narrow(CARRIED_SHARE)) >> 10;
    if ((force > learnt) && (climb > -by16(up(p->sink, 1), narrow(SLOW_SHARE)))) {
        p->carried += second;
    } else {
        p->carried = (p->carried > second) ? (p->carried - second) : 0;
    }
    const int32_t pull = pull_of(p);
    const int32_t struck = p->struck + second;
    p->struck = (struck < BLOW_LASTS) ? struck : BLOW_LASTS;
    if ((p->shown - pull) > BLOW) {
        p->struck = 0;
        p->try_at = CARRIED_TIME;
    }
    const bool is_carried = p->carried > CARRIED_TIME;
    if (is_carried || ((p->struck >= p->try_at) && (p->struck < BLOW_LASTS))) {
        p->unloaded = 1;
        p->began_at = pull;
        p->refuted = is_carried ? up(force, 16) : p->support;
        p->carried = 0;
        p->falling = 0;
        p->tested = 0;
    }
}

/* Take thrust away: on the ground the specific force stays, in the air it falls with it. */
static void test_ground(struct program *p)
{
    const int16_t second = p->gains.second;
    const int32_t unloaded = p->unloaded + up(by16(second, narrow(UNLOAD_RAMP)), 9);
    p->unloaded = (unloaded < UNLOAD_MOST) ? unloaded : UNLOAD_MOST;
    p->tested += second;
    p->struck += second;
    const int32_t pull = pull_of(p);
    const int32_t most = (pull < SHOWN_MEAN) ? pull : SHOWN_MEAN;
    const bool falls = p->shown < (((SHOWN_MEAN + most) >> 1) - SHOWN_MARGIN);
    p->falling = falls ? (p->falling + second) : 0;
    const bool gives_little = (pull < PULLING_LITTLE) || ((p->began_at - pull) > PULLING_LESS);
    const bool rests = p->shown > SHOWN_AT_REST;
    const bool over = p->tested > TEST_LONGEST;
    p->carried = (gives_little && rests) ? (p->carried + second) : 0;
    if ((p->carried > TEST_DWELL) || (over && rests)) {
        stop_motors(p);
    } else if ((p->falling > TEST_DWELL) || over) {
        p->carried = 0;
        p->unloaded = 0;
        p->support = p->refuted; /* that much lift the air gives */
        p->try_at = p->struck + CARRIED_TIME;
    } else {
        /* the test goes on */
    }
}

void descend(struct program *p, int16_t *registers)
{
    static const int32_t level[3] = {0, 0, 0};
    const int16_t second = p->gains.second;
    const int16_t cosine = vertical(p, 2);
    const int32_t above = p->height - p->ground;
    const int32_t climb = climb_rate(p);
    p->lasted += second;
    if ((above < DEEPEST) || ((p->lasted >> 4) > p->longest)) {
        p->faster += second >> FASTER_SHIFT;
    }
    const int32_t wanted = p->faster + ((above < FLARE_HEIGHT) ? SINK_FLARE : SINK);
    const int32_t change = (p->sink < 0) ? (2 * (int32_t)second) : second; /* 2 or 1 m/s^2 */
    p->sink += bounded(wanted - p->sink, change);
    if (p->unloaded == 0) {
        const int32_t error = bounded(-p->sink - climb, SINK_ERROR_MAX);
        const int32_t least = LIFT_COUNT * registers[ID_EMERGENCY_THRUST];
        const int32_t most = LIFT_COUNT * LIFT_MAX;
        p->lift = within(p->lift + by16(error, p->gains.lift), least, most);
        p->held = within(p->lift + by16(up(error, 6), narrow(CLIMB_GAIN)), least, most);
    }
    const int32_t wanted_thrust = (p->held > p->unloaded) ? (p->held - p->unloaded) : 0;
    const int32_t divisor = (cosine > COSINE_MIN) ? cosine : COSINE_MIN;
    hold_angles(p, registers, level, up(wanted_thrust >> 12, 14) / divisor);
    p->shown += by16(up(p->force_b[2], 16) - p->shown, p->gains.shown);
    p->pulling += by16(p->commanded - p->pulling, p->gains.pulling);
    if (p->unloaded > 0) {
        test_ground(p);
    } else {
        presume_ground(p, climb);
    }
    if (cosine < OVERTURNED) {
        stop_motors(p);
    }
}

void stop_motors(struct program *p)
{
    p->landed = true;
    p->landing = false;
    p->unloaded = 0;
    for (uint8_t i = 0; i < MOTORS; i++) {
        p->references[i] = 0;
    }
}
