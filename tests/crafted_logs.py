"""Crafted logs: with false or huge sizes, with circular references, and mutated ones.

They are written byte by byte, because no writer makes such files. `CRAFTED` has one maker for each
kind.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO

import lz4.frame
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from flight_log import LogWriter
from vehicle_link.messages import encode, header, new

START = 1_769_851_842_000_000_000
GIGABYTES = 3 * 10**9
TINY = b"\0\1\0\0\7"
"""CDR of `uint8 x`."""


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def text(words: str | bytes) -> bytes:
    data = words.encode() if isinstance(words, str) else words
    return struct.pack("<I", len(data)) + data


def schema(number: int, name: str, definition: str) -> bytes:
    content = struct.pack("<H", number) + text(name) + text("ros2msg") + text(definition)
    return record(Opcode.SCHEMA, content)


def channel(number: int, topic: str, of: int = 1) -> bytes:
    content = struct.pack("<HH", number, of) + text(topic) + text("cdr") + text(b"")
    return record(Opcode.CHANNEL, content)


def message(number: int, payload: bytes, stamp_ns: int = START) -> bytes:
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", number, 0, stamp_ns, stamp_ns) + payload)


def chunk(stored: bytes, size: int, compression: str = "lz4") -> bytes:
    """Return a chunk that claims `size` bytes when decompressed."""
    head = struct.pack("<QQQI", START, START, size, 0) + text(compression)
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(stored)) + stored)


def packed(pieces: Iterable[bytes]) -> bytes:
    """Return the data as one frame of lz4, piece by piece."""
    compressor = lz4.frame.LZ4FrameCompressor()
    found = [compressor.begin()] + [compressor.compress(piece) for piece in pieces]
    return b"".join([*found, compressor.flush()])


def ending(file: BinaryIO, count: int, descriptions: bytes, more: bytes = b"") -> None:
    """Write the index with statistics and footer; `more` are further records of the index."""
    file.write(record(Opcode.DATA_END, struct.pack("<I", 0)))
    begin = file.tell()
    counts = struct.pack("<IHQ", 10, 1, count)
    statistics = struct.pack("<QHIIIIQQ", count, 1, 1, 0, 0, 1, START, START + 10**9) + counts
    file.write(descriptions + record(Opcode.STATISTICS, statistics) + more)
    file.write(record(Opcode.FOOTER, struct.pack("<QQI", begin, 0, 0)) + MCAP0_MAGIC)


def write(
    path: Path,
    *records: bytes,
    count: int = 1,
    topic: str = "/q/tiny",
    kind: str = "uint8 x",
    more: bytes = b"",
) -> Path:
    descriptions = schema(1, "x/msg/Tiny", f"{kind}\n") + channel(1, topic)
    with path.open("wb") as file:
        file.write(MCAP0_MAGIC + record(Opcode.HEADER, text("ros2") + text("crafted")))
        file.write(descriptions)
        for one in records:
            file.write(one)
        ending(file, count, descriptions, more)
    return path


def claims_gigabytes(path: Path) -> Path:
    """Write a chunk of a few bytes that claims gigabytes."""
    return write(path, message(1, TINY), chunk(packed([message(1, TINY)]), GIGABYTES))


def holds_gigabytes(path: Path) -> Path:
    """Write a chunk of megabytes that has gigabytes, as it claims."""
    body = bytes(1_000_000)
    head = struct.pack("<BQ", 0x80, GIGABYTES - 9)  # a record that readers pass over
    pieces = [head, *[body] * (GIGABYTES // len(body) - 1), body[9:]]
    return write(path, message(1, TINY), chunk(packed(pieces), GIGABYTES))


def holds_more_than_it_claims(path: Path) -> Path:
    """Write a chunk of a megabyte that claims ten bytes, and has 250 MB."""
    pieces = [bytes(1_000_000)] * 250
    return write(path, message(1, TINY), chunk(packed(pieces), 10))


def at_the_limit(path: Path, size: int = 79_000_000) -> Path:
    """Write a chunk of the largest size that is read, full of the smallest messages."""
    one = message(1, TINY)
    count = size // len(one)
    pieces = [one * 1000] * (count // 1000)
    count = 1000 * (count // 1000)
    return write(path, chunk(packed(pieces), count * len(one)), count=count)


def many_tiny(path: Path, count: int = 10_000_000, topic: str = "/q/tiny") -> Path:
    """Write ten million messages of a byte each, in chunks of a megabyte without indexes."""
    per_chunk = 25_000
    data = b"".join(message(1, TINY, START + 1000 * k) for k in range(per_chunk))
    one = chunk(lz4.frame.compress(data), len(data))
    return write(path, *[one] * (count // per_chunk), count=count, topic=topic)


def many_loose(path: Path, count: int = 1_000_000) -> Path:
    """Write messages outside of chunks, and no index."""
    block = message(1, TINY) * 1000
    write(path, *[block] * (count // 1000), count=count)
    data = path.read_bytes()
    path.write_bytes(data[: data.rindex(record(Opcode.DATA_END, bytes(4)))])
    return path


def long_text(path: Path) -> Path:
    """Write a text that claims 4 GB, and one that has 60 MB."""
    claims = b"\0\1\0\0" + struct.pack("<I", 2**32 - 1) + b"abc\0"
    holds = b"\0\1\0\0" + struct.pack("<I", 60_000_001) + b"a" * 60_000_000 + b"\0"
    data = message(1, holds)
    return write(
        path, message(1, claims), chunk(packed([data]), len(data)), count=2, kind="string x"
    )


def long_array(path: Path) -> Path:
    """Write sequences that claim 4 billion items, of texts and of numbers."""
    claims = b"\0\1\0\0" + struct.pack("<I", 2**32 - 1) + bytes(8)
    empty = b"\0\1\0\0" + struct.pack("<I", 10_000_000) + bytes(40_000_000)
    data = message(1, empty)
    return write(
        path, message(1, claims), chunk(packed([data]), len(data)), count=2, kind="string[] x"
    )


def deep_arrays(path: Path) -> Path:
    """Write a type of nested empty arrays, a thousand times a thousand times a thousand."""
    parts = [
        "x/B[1000] b",
        "=" * 80,
        "MSG: x/B",
        "x/C[1000] c",
        "=" * 80,
        "MSG: x/C",
        "x/D[1000] d",
        "=" * 80,
        "MSG: x/D",
        "uint8[0] e",
    ]
    return write(path, message(1, TINY), kind="\n".join(parts))


def attached(path: Path) -> Path:
    """Write attachments of 200 MB together, and one that claims 4 GB."""

    def one(number: int, size: int, data: bytes) -> bytes:
        head = struct.pack("<QQ", START, START) + text(f"a{number}") + text("x")
        content = head + struct.pack("<Q", size) + data + struct.pack("<I", 0)
        return record(Opcode.ATTACHMENT, content)

    body = bytes(40_000_000)
    whole = [one(k, len(body), body) for k in range(5)]
    return write(path, one(9, 4 * 10**9, b"x"), message(1, TINY), *whole)


def long_metadata(path: Path) -> Path:
    """Write a metadata record of millions of pairs."""
    pairs = (text("") + text("")) * 3_000_000
    return write(path, record(Opcode.METADATA, text("m") + text(pairs)), message(1, TINY))


def index_in_circles(path: Path) -> Path:
    """Write chunk indexes that refer to the same chunk, to the index and to nowhere."""
    data = message(1, TINY)
    one = chunk(packed([data]), len(data))
    begin = len(MCAP0_MAGIC)
    more = b"".join(
        record(
            Opcode.CHUNK_INDEX,
            struct.pack("<QQQQI", START, START, place, len(one), 0)
            + struct.pack("<Q", 0)
            + text("lz4")
            + struct.pack("<QQ", len(one), len(data)),
        )
        for place in [begin, begin, len(one), 2**63, 2**64 - 1] * 20_000
    )
    return write(path, one, more=more)


def index_of_itself(path: Path) -> Path:
    """Write a footer whose index begins at the start of the file."""
    data = write(path, message(1, TINY)).read_bytes()
    footer = record(Opcode.FOOTER, struct.pack("<QQI", 8, 8, 0)) + MCAP0_MAGIC
    path.write_bytes(data[: -len(footer)] + footer)
    return path


def repeated_places(path: Path) -> Path:
    """Write a message index that names one message of 4 MB many thousand times."""
    body = message(1, b"\0\1\0\0" + bytes(4_000_000))
    entries = struct.pack("<QQ", START, 0) * 200_000
    index = record(Opcode.MESSAGE_INDEX, struct.pack("<HI", 1, len(entries)) + entries)
    return write(path, chunk(packed([body]), len(body)), index, count=1)


def mutated(data: bytes, number: int) -> bytes:
    """Return the log damaged at random by a seed.

    Bits are flipped, lengths made huge, pieces cut, duplicated or swapped.
    """
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


def sound(path: Path) -> Path:
    """Write a short log like those of the station, to be mutated."""
    with LogWriter(path, {"vehicle": "q"}, {"parameters.json": b"{}"}) as log:
        for k in range(300):
            stamp = START + k * 2_000_000
            message = encode(new("sensor_msgs/Imu", header=header(stamp, "q/body")))
            log.write("/q/imu", "sensor_msgs/Imu", message, stamp, stamp)
            if k % 10 == 0:
                event = encode(new("rcl_interfaces/Log", msg=f"event {k}"))
                log.write("/q/events", "rcl_interfaces/Log", event, stamp, stamp)
    return path


CRAFTED: dict[str, Callable[[Path], Path]] = {
    make.__name__: make
    for make in (
        claims_gigabytes,
        holds_gigabytes,
        holds_more_than_it_claims,
        at_the_limit,
        many_tiny,
        many_loose,
        long_text,
        long_array,
        deep_arrays,
        attached,
        long_metadata,
        index_in_circles,
        index_of_itself,
        repeated_places,
    )
}
