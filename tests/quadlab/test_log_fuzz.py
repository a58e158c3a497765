"""Mutated logs through the commands: a line at most, a known status, the file as it was."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import pytest

from quadlab.__main__ import main
from vehicle_link.log import LogWriter
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_000_000_000
COUNT = 24
WORDS = (["log", "info"], ["log", "check"], ["log", "export"], ["replay"], ["log", "recover"])


def mutated(data: bytes, number: int) -> bytes:
    """By its number: bits turned, lengths made huge, pieces cut, doubled or swapped."""
    chance = random.Random(number)
    out = bytearray(data)
    for _ in range(chance.choice((1, 3, 20))):
        place = chance.randrange(8, len(out) - 16)
        kind = chance.randrange(4)
        if kind == 0:
            out[place] ^= 1 << chance.randrange(8)
        elif kind == 1:
            huge = chance.choice((2**32 - 1, 2**63, 2**64 - 1, 4 * 10**9, 0))
            out[place : place + 8] = struct.pack("<Q", huge)
        elif kind == 2:
            del out[place : place + chance.randrange(1, 200)]
        else:
            piece = out[place : place + chance.randrange(1, 400)]
            other = chance.randrange(8, len(out))
            out[other:other] = piece
    return bytes(out)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("log") / "sound.mcap"
    with LogWriter(path, {"vehicle": "q"}, {"parameters.json": b"{}"}) as log:
        for k in range(300):
            stamp = START + k * 2_000_000
            message = encode(new("sensor_msgs/Imu", header=header(stamp, "q/body")))
            log.write("/q/imu", "sensor_msgs/Imu", message, stamp, stamp)
            if k % 10 == 0:
                event = encode(new("rcl_interfaces/Log", msg=f"event {k}"))
                log.write("/q/events", "rcl_interfaces/Log", event, stamp, stamp)
    return path.read_bytes()


@pytest.mark.parametrize("number", range(COUNT))
def test_a_mutated_log_costs_a_line_and_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], sound: bytes, number: int
) -> None:
    log = tmp_path / "a.mcap"
    log.write_bytes(mutated(sound, number))
    before = log.read_bytes()
    for words in WORDS:
        more = ["--out", str(tmp_path / "out")] if words[-1] == "export" else []
        assert main([*words, str(log), *more]) in (0, 1, 2), words
        assert capsys.readouterr().err.count("\n") <= 1, words
        if words[-1] != "recover":
            assert log.read_bytes() == before, words
