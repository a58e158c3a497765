"""CRSF: the channels of a frame, read back bit by bit and by Betaflight's own receiver."""

from __future__ import annotations

import math
import random
import subprocess
from pathlib import Path

import pytest

from extensions.betaflight.msp.crsf import BAUD_RATE, encode_channels
from extensions.betaflight.msp.frames import crc8
from extensions.betaflight.simulated.process import FIRMWARE
from quadrotor.errors import OutOfBoundsError


def counts_of(frame: bytes) -> list[int]:
    """Read the channels as the protocol's text describes them, one bit at a time."""
    bits = [byte >> k & 1 for byte in frame[3:25] for k in range(8)]
    return [sum(bits[11 * c + k] << k for k in range(11)) for c in range(16)]


def test_a_frame_has_address_length_type_and_checksum() -> None:
    frame = encode_channels([1500.0] * 16)
    assert (len(frame), frame[0], frame[1], frame[2]) == (26, 0xC8, 24, 0x16)
    assert crc8(frame[2:]) == 0  # of a body with its own checksum
    assert counts_of(frame) == [992] * 16


def test_channels_keep_their_places_and_the_rest_is_in_the_middle() -> None:
    frame = encode_channels([1000.0, 2000.0, 1500.0, 988.0, 2012.0])
    assert counts_of(frame) == [192, 1792, 992, 173, 1811, *[992] * 11]


@pytest.mark.parametrize("pulse", [879.0, 2160.0, math.nan, math.inf])
def test_pulses_beyond_eleven_bits_are_refused(pulse: float) -> None:
    with pytest.raises(OutOfBoundsError, match=r"channel 2 of .* µs cannot be sent"):
        encode_channels([1500.0, pulse])


def test_seventeen_channels_are_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="17 channels cannot be sent"):
        encode_channels([1500.0] * 17)


@pytest.mark.needs("betaflight", "gcc")
def test_betaflights_own_receiver_reads_our_channels(tmp_path: Path) -> None:
    sources = next(folder for folder in FIRMWARE.parents if (folder / "src" / "main").is_dir())
    simulator = sources / "src" / "platform" / "SIMULATOR"
    folders = [
        sources / "src" / "main",
        sources / "src" / "main" / "target",
        simulator / "target" / "SITL",
        simulator,
        simulator / "include",
        sources / "lib" / "main" / "dyad",
    ]
    flags = ["-std=gnu17", "-w", "-O1", "-DSITL", "-DSIMULATOR_BUILD", "-DHSE_VALUE=8000000"]
    flags += [f'-D__{name}__="x"' for name in ("TARGET", "REVISION")]
    flags += ["-DTARGET_FLASH_SIZE=2048", "-DFLASH_SIZE=2048", *(f"-I{one}" for one in folders)]
    receiver = tmp_path / "receiver"
    source = Path(__file__).with_name("betaflight_receiver.c")
    subprocess.run(["gcc", *flags, source, "-o", receiver], check=True)

    generator = random.Random(1)
    sent = [[float(generator.randrange(880, 2160)) for _ in range(16)] for _ in range(200)]
    frames = [encode_channels(pulses) for pulses in sent]
    damaged = bytearray(frames[0])
    damaged[10] ^= 4
    told = subprocess.run(
        [receiver], input=bytes(damaged) + b"".join(frames), capture_output=True, check=True
    )
    baud, *lines = told.stdout.decode().splitlines()
    assert int(baud) == BAUD_RATE
    assert len(lines) == len(sent), "the damaged frame is refused, and no other"
    for pulses, line in zip(sent, lines, strict=True):
        # It takes a count for 0.6248 µs from 881 µs on, which is up to 1.1 µs more than 5/8 µs
        # around 1500 µs; half a count is lost to rounding.
        assert [float(word) for word in line.split()] == pytest.approx(pulses, abs=1.5)
