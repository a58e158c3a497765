"""Frames of Betaflight's blackbox, decoded by compiled functions.

A frame is a letter and a number for each field of its kind, written by the field's encoding as the
difference to what its predictor expects. An `I` frame stands alone, a `P` frame continues the
frames before it, `S`, `G` and `H` are slow, GPS and home frames, `E` is an event.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Array

Bytes = npt.NDArray[np.uint8]
Numbers = npt.NDArray[np.int64]

SIGNED_VB, UNSIGNED_VB, NEGATIVE_14, TAG8_8SVB, TAG2_3S32, TAG8_4S16 = 0, 1, 3, 6, 7, 8
NOTHING, TAG2_3SVARIABLE, TAG8_4S16_OLD = 9, 10, 108  # the last: as data version 1 wrote it
GROUPS = {TAG8_8SVB: 8, TAG2_3S32: 3, TAG2_3SVARIABLE: 3, TAG8_4S16: 4, TAG8_4S16_OLD: 4}
"""Number of fields that are written together, by encoding; of the first, at most."""
ENCODINGS = {SIGNED_VB, UNSIGNED_VB, NEGATIVE_14, NOTHING, *GROUPS}
PREDICTORS = range(12)
(SIGNED, I_PREDICTOR, I_ENCODING, P_PREDICTOR, P_ENCODING) = range(5)  # rows of `fields`
(ITERATION, TIME, MOTOR0, I_INTERVAL, P_PART, P_OF, MIN_THROTTLE, VBAT, MIN_MOTOR) = range(9)
"""Places in `setting`: columns of iteration, time and motor 0 (-1: none), of how many iterations
which are logged, and the numbers that predictors need."""
(AT, WHOLE_TO, SEARCHES, STARTED, LAST_I, DAMAGED, ENDED, LAST_ITERATION, LAST_TIME,
 FIRST_ITERATION, FIRST_TIME, COUNT) = range(12)  # fmt: skip
"""Places in `state`: bytes read, and those of whole frames; whether an I frame is searched after a
damage, whether there was one; the row of the last one, -1 before; damages; whether the log's end
was found; iteration and time of the last and the first frame; rows written."""
STATES = 12
INTRA, INTER, EVENT = b"IPE"
LETTERS, OTHERS, END = tuple(b"IPSGHE"), tuple(b"SGH"), tuple(b"End of log")
MASK = (1 << 32) - 1
LONGEST_STEP = 10_000_000
"""us between two frames that follow one another."""
SLACK = 1_000_000
"""us by which the first frame after a damage may be later than expected by twice the usual step."""


@compiled(inner=True)
def _byte(data: Bytes, cursor: Numbers) -> int:
    place = cursor[0]
    cursor[0] = place + 1
    return int(np.int64(data[place])) if place < len(data) else 0


@compiled(inner=True)
def _unsigned(data: Bytes, cursor: Numbers) -> int:
    value = 0
    for k in range(5):
        part = _byte(data, cursor)
        value |= (part & 0x7F) << (7 * k)
        if part < 0x80:
            return value & MASK
    cursor[1] = 1  # no number is longer
    return 0


@compiled(inner=True)
def _signed(data: Bytes, cursor: Numbers) -> int:
    value = _unsigned(data, cursor)
    return (value >> 1) ^ -(value & 1)


@compiled(inner=True)
def _extended(value: int, bits: int) -> int:
    """Return a number of two's complement in the lowest bits."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


@compiled(inner=True)
def _little(data: Bytes, cursor: Numbers, size: int) -> int:
    value = 0
    for k in range(size):
        value |= _byte(data, cursor) << (8 * k)
    return _extended(value, 8 * size)


@compiled(inner=True)
def _three(data: Bytes, cursor: Numbers, variable: bool, out: Numbers) -> None:
    """Read three numbers of one size, or of a size each."""
    head = _byte(data, cursor)
    size = head >> 6
    if size == 0:
        for k in range(3):
            out[k] = _extended(head >> (4 - 2 * k), 2)
    elif size == 1 and variable:
        both = (head << 8) | _byte(data, cursor)  # 5, 5 and 4 bits
        out[0], out[1], out[2] = _extended(both >> 9, 5), _extended(both >> 4, 5), 0
        out[2] = _extended(both, 4)
    elif size == 1:
        both = (head << 8) | _byte(data, cursor)
        for k in range(3):
            out[k] = _extended(both >> (8 - 4 * k), 4)
    elif size == 2:
        three = (head << 16) | (_byte(data, cursor) << 8)
        three |= _byte(data, cursor)
        if variable:  # 8, 7 and 7 bits
            out[0], out[1] = _extended(three >> 14, 8), _extended(three >> 7, 7)
            out[2] = _extended(three, 7)
        else:
            for k in range(3):
                out[k] = _extended(three >> (16 - 8 * k), 6)
    else:
        for k in range(3):
            out[k] = _little(data, cursor, 1 + ((head >> (2 * k)) & 3))


@compiled(inner=True)
def _four(data: Bytes, cursor: Numbers, out: Numbers) -> None:
    """Read four numbers of 0, 4, 8 or 16 bits, which are written half byte by half byte."""
    head = _byte(data, cursor)
    held, has_held = 0, False
    for k in range(4):
        halves = (0, 1, 2, 4)[(head >> (2 * k)) & 3]
        value = 0
        for _ in range(halves):
            if not has_held:
                held = _byte(data, cursor)
                value = (value << 4) | (held >> 4)
            else:
                value = (value << 4) | (held & 0xF)
            has_held = not has_held
        out[k] = _extended(value, 4 * halves) if halves else 0


@compiled(inner=True)
def _four_old(data: Bytes, cursor: Numbers, out: Numbers) -> None:
    """Read four numbers as data version 1 wrote them: two of 4 bits in a byte, low half first."""
    head = _byte(data, cursor)
    k = 0
    while k < 4:
        size = (head >> (2 * k)) & 3
        if size == 1:
            both = _byte(data, cursor)
            out[k] = _extended(both, 4)
            k += 1
            if k < 4:
                out[k] = _extended(both >> 4, 4)
        else:
            out[k] = _little(data, cursor, size - 1) if size else 0
        k += 1


@compiled(inner=True)
def _eight(data: Bytes, cursor: Numbers, count: int, out: Numbers) -> None:
    """Read up to eight numbers, those that are not 0 as the bits of the first byte tell."""
    head = _byte(data, cursor) if count > 1 else 1
    for k in range(count):
        out[k] = _signed(data, cursor) if (head >> k) & 1 else 0
    if head >> count:
        cursor[1] = 1


@compiled(inner=True)
def _fields(data: Bytes, cursor: Numbers, encodings: Numbers, group: Numbers, out: Numbers) -> None:
    """Read the numbers of a frame, one for each encoding."""
    k = 0
    while k < len(encodings):
        encoding = encodings[k]
        count = 1
        if encoding == SIGNED_VB:
            out[k] = _signed(data, cursor)
        elif encoding == UNSIGNED_VB:
            out[k] = _unsigned(data, cursor)
        elif encoding == NEGATIVE_14:
            out[k] = -_extended(_unsigned(data, cursor), 14)
        elif encoding == NOTHING:
            out[k] = 0
        else:
            if encoding == TAG8_8SVB:
                while count < 8 and k + count < len(encodings) and encodings[k + count] == encoding:
                    count += 1
                _eight(data, cursor, count, group)
            elif encoding == TAG8_4S16:
                count = 4
                _four(data, cursor, group)
            elif encoding == TAG8_4S16_OLD:
                count = 4
                _four_old(data, cursor, group)
            else:
                count = 3
                _three(data, cursor, encoding == TAG2_3SVARIABLE, group)
            for one in range(count):
                out[k + one] = group[one]
        k += count


@compiled(inner=True)
def _is_logged(iteration: int, setting: Numbers) -> bool:
    place = iteration % setting[I_INTERVAL] + setting[P_PART] - 1
    return bool(place % setting[P_OF] < setting[P_PART])


@compiled(inner=True)
def _next_iteration(last: int, setting: Numbers) -> int:
    """Return the iteration that is logged after `last`."""
    iteration = last + 1
    for _ in range(setting[I_INTERVAL]):
        if _is_logged(iteration, setting):
            break
        iteration += 1
    return iteration & MASK


@compiled(inner=True)
def _predicted(
    predictor: int, k: int, is_signed: bool, now: Numbers, past: Numbers, setting: Numbers
) -> int:
    """Return what a predictor expects for field k; `past` has the last two frames."""
    last, before = int(past[0, k]), int(past[1, k])
    if predictor == 1:
        return last
    if predictor == 2:
        return 2 * last - before
    if predictor == 3:
        total = last + before
        if not is_signed:
            return (total & MASK) >> 1
        return -((-total) >> 1) if total < 0 else total >> 1
    if predictor == 4:
        return int(setting[MIN_THROTTLE])
    if predictor == 5:
        return int(now[setting[MOTOR0]])
    if predictor == 6:
        return _next_iteration(last, setting)
    if predictor == 8:
        return 1500
    if predictor == 9:
        return int(setting[VBAT])
    if predictor == 11:
        return int(setting[MIN_MOTOR])
    return 0


@compiled(inner=True)
def _event(data: Bytes, cursor: Numbers, state: Numbers) -> None:
    """Read an event; the end of the log and a pause of it change the state."""
    kind = _byte(data, cursor)
    if kind in (0, 15, 40):  # beep, disarmed, failure of the IMU
        _unsigned(data, cursor)
    elif kind == 30:  # mode
        _unsigned(data, cursor)
        _unsigned(data, cursor)
    elif kind == 13:  # adjustment in flight
        if _byte(data, cursor) & 0x80:
            cursor[0] += 4
        else:
            _signed(data, cursor)
    elif kind == 14:  # resumed
        _unsigned(data, cursor)
        _unsigned(data, cursor)
        state[STARTED] = 0  # an I frame follows, at any iteration and time
    elif kind == 255:
        for one in END:
            if _byte(data, cursor) != one:
                cursor[1] = 1
        state[ENDED] = 1 if cursor[1] == 0 and cursor[0] <= len(data) else 0
    else:
        cursor[1] = 1


@compiled(inner=True)
def _follows(now: Numbers, setting: Numbers, state: Numbers) -> bool:
    """Return whether a frame can follow the last one."""
    if not state[STARTED]:
        return True
    steps = (now[setting[ITERATION]] - state[LAST_ITERATION]) & MASK
    time = (now[setting[TIME]] - state[LAST_TIME]) & MASK
    if steps == 0 or steps > MASK >> 1 or time > MASK >> 1:
        return False
    if not state[SEARCHES]:
        return bool(time < LONGEST_STEP)
    past_steps = (state[LAST_ITERATION] - state[FIRST_ITERATION]) & MASK
    past_time = (state[LAST_TIME] - state[FIRST_TIME]) & MASK
    if now[setting[ITERATION]] % setting[I_INTERVAL]:
        return False
    if past_steps == 0:
        return True
    usual = steps * (past_time / past_steps)
    return bool(0.5 * usual <= time + 1 and time <= 2.0 * usual + SLACK)


@compiled(inner=True)
def _is_letter(data: Bytes, place: int) -> bool:
    return place == len(data) or (place < len(data) and data[place] in LETTERS)


@compiled(inner=True)
def _main_frame(
    data: Bytes,
    cursor: Numbers,
    fields: Numbers,
    setting: Numbers,
    state: Numbers,
    past: Numbers,
    now: Numbers,
) -> bool:
    """Read a frame of the letter at `cursor`; return whether it is whole and can follow."""
    is_intra = data[cursor[0] - 1] == INTRA
    predictors = fields[I_PREDICTOR] if is_intra else fields[P_PREDICTOR]
    _fields(data, cursor, fields[I_ENCODING] if is_intra else fields[P_ENCODING], past[2], now)
    if cursor[1] or cursor[0] > len(data) or not _is_letter(data, cursor[0]):
        return False
    for k in range(len(now)):
        is_signed = fields[SIGNED, k] != 0
        value = now[k] + _predicted(predictors[k], k, is_signed, now, past, setting)
        now[k] = _extended(value, 32) if is_signed else value & MASK
    return _follows(now, setting, state)


@compiled(inner=True)
def _kept(now: Numbers, count: int, setting: Numbers, state: Numbers) -> int:
    """Return the number of rows before this I frame: without those after the one before it if a
    frame is missing in between, because each of them is told by its difference to the one before.
    """
    if not state[STARTED]:
        state[FIRST_ITERATION], state[FIRST_TIME] = now[setting[ITERATION]], now[setting[TIME]]
    elif not state[SEARCHES] and (
        _next_iteration(state[LAST_ITERATION], setting) != now[setting[ITERATION]]
    ):
        state[DAMAGED] += 1
        count = min(count, max(state[LAST_I] + 1, 0))
    return count


@compiled(nogil=True)
def decode(
    data: Bytes,
    stop: int,
    fields: Numbers,
    others: Numbers,
    setting: Numbers,
    state: Numbers,
    past: Numbers,
    columns: Numbers,
    rows: Array,
) -> None:
    """Write fields of the I and P frames of a piece of a log to `rows`, until these are full.

    Args:
        data: the piece, behind the log's header.
        stop: where the next piece begins at the latest; up to it all frames are whole.
        fields: (5, K): signed, predictor and encoding of I, of P frames.
        others: (3, L): encodings of S, G and H frames, NOTHING behind the last one.
        setting, state: as the constants name their places; the state is changed.
        past: (3, L), L of at least K and 8: the last two frames, and space; changed.
        columns: (M,): the fields to write.
        rows: (M, N), of all pieces.
    """
    count, now = state[COUNT], np.zeros(fields.shape[1], np.int64)
    cursor, spare = np.zeros(2, np.int64), np.zeros(others.shape[1], np.int64)
    while state[AT] < stop and count < rows.shape[1] and not state[ENDED]:
        letter, good = data[state[AT]], False
        cursor[0], cursor[1] = state[AT] + 1, 0
        if letter == INTRA or (letter == INTER and not state[SEARCHES]):
            good = _main_frame(data, cursor, fields, setting, state, past, now=now)
            if good and letter == INTRA:
                count = _kept(now, count, setting, state)
                state[LAST_I], state[STARTED], state[SEARCHES] = count, 1, 0
                past[1, : len(now)] = now
            if good and state[STARTED]:
                if letter == INTER:
                    past[1] = past[0]
                past[0, : len(now)] = now
                for k in range(len(columns)):
                    rows[k, count] = now[columns[k]]
                count += 1
                state[LAST_ITERATION], state[LAST_TIME] = (
                    now[setting[ITERATION]],
                    now[setting[TIME]],
                )
        elif letter == EVENT:
            _event(data, cursor, state)
            good = state[ENDED] != 0 or (
                cursor[1] == 0 and not state[SEARCHES] and _is_letter(data, cursor[0])
            )
        elif not state[SEARCHES]:
            for k in range(3):
                if letter == OTHERS[k]:
                    _fields(data, cursor, others[k], past[2], spare)
                    good = cursor[1] == 0 and _is_letter(data, cursor[0])
        if good:
            state[AT] = state[WHOLE_TO] = cursor[0]
        else:
            state[DAMAGED] += 1 - state[SEARCHES]
            state[SEARCHES] = 1
            state[AT] += 1
    state[COUNT] = count
