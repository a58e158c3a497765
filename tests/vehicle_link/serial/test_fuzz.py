"""Random, truncated, interleaved and hostile bytes: nothing raises, accumulates or costs more.

Every random stream is made from a seed that is part of the test's name.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator

import pytest

from quadrotor.motor_state import MotorState
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.firmware.firmware import Firmware
from vehicle_link.serial import commands as c
from vehicle_link.serial.frames import MAX_FRAME, Frame, FrameDecoder, encode_frame
from vehicle_link.serial.ids import Id
from vehicle_link.serial.port import memory_port_pair

BYTES = 10_000_000
COMMANDS = tuple(bytes([byte]) for byte in b"bsulSDL")
STOPPED = (0, 0, 0, 0)
Random = random.Random


def a_frame(generator: Random) -> bytes:
    return encode_frame(generator.choice(COMMANDS), generator.randbytes(generator.randrange(43)))


def flipped(generator: Random) -> bytes:
    data = bytearray(a_frame(generator))
    for _ in range(generator.randrange(1, 4)):
        data[generator.randrange(len(data))] ^= 1 << generator.randrange(8)
    return bytes(data)


def truncated(generator: Random) -> bytes:
    data = a_frame(generator)
    return data[: generator.randrange(len(data))]


def interleaved(generator: Random) -> bytes:
    one, other = a_frame(generator), a_frame(generator)
    cut = generator.randrange(1, len(one))
    return one[:cut] + other + one[cut:]


def endless(generator: Random) -> bytes:
    """Return data characters without an end, and sometimes a start."""
    return generator.choice((b"#", b"#b", b"", b"\0")) + b"=?A" * generator.randrange(400)


def repeated(generator: Random) -> bytes:
    return generator.choice((b"#", b"\r", b"#\r", b"#b\r", b"\xff", b"##b=\r")) * 100


def forged(generator: Random) -> bytes:
    """Return a correct checksum around invalid or too long data64."""
    body = b"#b" + generator.choice((b"SAA", b"S" + b"=" * 80, b"S\0\0\0\0", b"S~~~~", b""))
    total = sum(body) % 4096
    return body + bytes((61 + total // 64, 61 + total % 64)) + b"\r"


def noise(generator: Random) -> bytes:
    return generator.randbytes(generator.randrange(300))


HOSTILE: tuple[Callable[[Random], bytes], ...] = (
    flipped,
    truncated,
    interleaved,
    endless,
    repeated,
    forged,
    noise,
)


def pieces(generator: Random, stream: bytes, most: int) -> Iterator[bytes]:
    at = 0
    while at < len(stream):
        size = generator.randrange(1, most)
        yield stream[at : at + size]
        at += size


def decode(data: bytes) -> Frame:
    (frame,) = FrameDecoder().feed(data)
    return frame


@pytest.mark.parametrize("seed", [1])
def test_20_000_random_frames_round_trip_in_any_pieces(seed: int) -> None:
    generator = random.Random(seed)
    sent, frames = [], []
    for _ in range(20_000):
        command, payload = generator.choice(COMMANDS), generator.randbytes(generator.randrange(43))
        sent.append(Frame(ord("b"), command[0], payload + bytes(-len(payload) % 3)))
        frames.append(encode_frame(command, payload))
    decoder = FrameDecoder()
    found = [f for p in pieces(generator, b"".join(frames), 200) for f in decoder.feed(p)]
    assert found == sent
    assert decoder.damaged == 0


@pytest.mark.parametrize("seed", [2])
def test_10_million_hostile_bytes_cost_no_undamaged_frame_and_do_not_pile_up(seed: int) -> None:
    generator = random.Random(seed)
    decoder = FrameDecoder()
    fed = 0
    while fed < BYTES:
        parts: list[bytes] = []
        whole: list[Frame] = []
        for _ in range(20):
            parts += (generator.choice(HOSTILE)(generator) for _ in range(generator.randrange(6)))
            parts.append(a_frame(generator))
            whole.append(decode(parts[-1]))
        data = b"".join(parts)
        found = iter([f for p in pieces(generator, data, 900) for f in decoder.feed(p)])
        for frame in whole:
            assert frame in found, f"a frame of seed {seed}, before byte {fed + len(data)}, is lost"
        assert len(decoder._rest) <= MAX_FRAME
        fed += len(data)
    assert decoder.damaged > 10_000


@pytest.mark.parametrize("byte", [b"#", b"b", b"=", b"\0", b"\r"])
def test_a_line_that_says_one_thing_for_ever_keeps_no_more_than_a_frame(byte: bytes) -> None:
    decoder = FrameDecoder()
    for _ in range(50_000):
        decoder.feed(byte)
        assert len(decoder._rest) <= MAX_FRAME
    after = c.encode_value(Id.BATTERY, 148)
    assert decoder.feed(after) == [decode(after)]


# ---------------------------------------------------------------- both ends whole
def nonsense(generator: Random) -> bytes:
    """Return well-formed frames of the microcontroller with random content."""
    kind = generator.randrange(3)
    if kind == 0:
        return c.encode_value(generator.randrange(-32768, 32768), generator.randrange(-200, 200))
    if kind == 1:
        return c.encode_data(generator.randbytes(20))
    return c.encode_mirrored([generator.randrange(65) for _ in range(10)])


@pytest.mark.parametrize("real_time", [False, True], ids=["simulated time", "host time"])
@pytest.mark.parametrize("seed", range(3))
def test_the_microcontroller_interface_survives_any_bytes(seed: int, real_time: bool) -> None:
    generator = random.Random(seed)
    pairs = [memory_port_pair(), memory_port_pair()]
    mcu = Microcontroller([near for near, _ in pairs], None if real_time else 0)
    kinds = (*HOSTILE, nonsense, nonsense, a_frame)
    for step in range(3_000):
        for _, far in pairs:
            for _ in range(generator.randrange(4)):
                far.write(generator.choice(kinds)(generator)[:1000])
            far.read()
        mcu.receive()
        if generator.random() < 0.01:
            mcu.set_motor_state(generator.choice(list(MotorState)))
        a, b, c, d = (generator.randrange(256) for _ in range(4))
        mcu.command((a, b, c, d))
        mcu.service(step * 0.002)
    assert mcu.damaged > 1_000
    firmware = Firmware()
    for step in range(1_000):  # a sound one works afterwards
        for index, (_, far) in enumerate(pairs):
            far.write(b"\r" + firmware.receive(index, far.read()))
        mcu.receive()
        mcu.service(6.0 + step * 0.01)
        if mcu.connected:
            break
    assert mcu.connected


@pytest.mark.parametrize("seed", range(3))
def test_the_firmware_survives_any_bytes_and_still_answers(seed: int) -> None:
    generator = random.Random(seed)
    firmware = Firmware()
    for step in range(3_000):
        for port in (0, 1):
            firmware.receive(port, generator.choice((*HOSTILE, a_frame))(generator))
        firmware.advance(2 * step)
        firmware.next_data()
    for port in (0, 1):
        replies = firmware.receive(port, b"\r" + c.encode_request(STOPPED, Id.ROBOT_ID))
        assert c.decode_value(decode(replies)) == (Id.ROBOT_ID, 1)
