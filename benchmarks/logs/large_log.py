"""A log of ROS 2 that is larger than memory, in the commands that read one.

    python -m benchmarks large_log [--gigabytes 25]

A camera's pictures make it large: each chunk has one, and the IMU's and tracker's messages of the
same time, as rosbag2 writes them. The pictures are black, and take no room on a disk that can leave
out zeros.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import IO, BinaryIO, cast

import numpy as np
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_typestore

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.logs.logs import measured
from extensions.importers.tests.bag_writer import write_bag
from extensions.importers.tests.foreign_flight import make_flight
from flight_log.records import RawMessage, records

GIGABYTES = 2.0, 0.5, 0.02  # of each size
RATE, FRAME_RATE = 200, 25  # Hz
WIDTH, HEIGHT = 1280, 720
MOST_MB = 500.0
PIECE = 1 << 16
"""Bytes that are left out together, if all of them are 0."""
COMMANDS = ("log info", "log check", "log import", "log export --topics imu")


def run(size: Size = Size.FULL, gigabytes: float | None = None) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    wanted = gigabytes or size.of(*GIGABYTES)
    report = Report(
        "large_log",
        "A log of ROS 2 with pictures",
        [f"{wanted:g} GB; each command in a process of its own, its start included"],
    )
    with tempfile.TemporaryDirectory(prefix="quadlab-large-") as name:
        folder = Path(name)
        log = write_large(folder, wanted * 1e9)
        for command in COMMANDS:
            group, verb, *more = command.split()
            words = [group, verb, str(log), *more]
            if verb == "import":
                words += ["--data", str(folder / "data")]
            if verb == "export":
                words += ["--out", str(folder / "out")]
            found = measured(sys.executable, "-m", "quadlab", *words)
            figures: dict[str, float | str] = {
                "s": found.seconds,
                "processor, s": found.busy,
                "MB": found.megabytes,
            }
            report.rows.append(Row(command, figures))
            report.targets.append(Target(f"{command}: MB", found.megabytes, MOST_MB))
    return report


class Sparse:
    """A file whose long rows of zeros are left out."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, data: bytes) -> int:
        for begin in range(0, len(data), PIECE):
            piece = data[begin : begin + PIECE]
            if len(piece) == PIECE and piece.count(0) == PIECE:
                self._file.seek(PIECE, 1)
            else:
                self._file.write(piece)
        return len(data)

    def tell(self) -> int:
        return self._file.tell()

    def flush(self) -> None:
        self._file.flush()


def write_large(folder: Path, size: float) -> Path:
    """Write a bag with pictures of about `size` bytes, as one MCAP file."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types, kind = store.types, "sensor_msgs/msg/Image"
    pixels = np.zeros(WIDTH * HEIGHT * 3, np.uint8)
    seconds = max(size / (pixels.nbytes * FRAME_RATE), 1.0)
    flight = make_flight(seconds=seconds, step=1.0 / RATE)
    [bag] = write_bag(folder / "bag", flight, 2, mcap=True).glob("*.mcap")
    head = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 0), "camera")
    image = types[kind](head, HEIGHT, WIDTH, "rgb8", 0, 3 * WIDTH, pixels)
    picture = bytes(store.serialize_cdr(image, kind))
    with (folder / "large.mcap").open("wb") as file:
        # A chunk ends behind each picture, which is larger than a chunk should be.
        writer = Writer(
            cast("IO[bytes]", Sparse(file)), compression=CompressionType.NONE, enable_crcs=False
        )
        writer.start("ros2", "benchmark")
        text, _ = store.generate_msgdef(kind, ros_version=2)
        camera = writer.register_channel(
            "/camera",
            "cdr",
            writer.register_schema("sensor_msgs/msg/Image", "ros2msg", text.encode()),
        )
        due_ns = 0
        for record in records(bag):
            match record:
                case Schema():
                    writer.register_schema(record.name, record.encoding, record.data)
                case Channel():
                    writer.register_channel(record.topic, "cdr", record.schema_id + 1)
                case RawMessage():
                    ns = record.log_ns
                    writer.add_message(record.channel_id + 1, ns, record.payload, ns)
                    if ns >= due_ns:
                        writer.add_message(camera, ns, picture, ns)
                        due_ns = ns + 10**9 // FRAME_RATE
        writer.finish()
    return folder / "large.mcap"
