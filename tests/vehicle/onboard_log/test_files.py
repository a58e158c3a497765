"""The vehicle's logs as files: their list and their bytes."""

from __future__ import annotations

import hashlib
import os
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadrotor.errors import StorageError
from quadrotor.records import Record
from tests.support.ticks import START_NS, STEP_NS, level_ticks
from vehicle.onboard_log.file import Batch, Message
from vehicle.onboard_log.files import PART_BYTES, OnboardFiles
from vehicle.onboard_log.onboard_log import OnboardLog
from vehicle.onboard_log.repair import recover_logs, torn_logs
from vehicle_link.messages import decode, encode, new
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import answering

BATCH = 5
BOUND = 10.0
"""Time, in s, after which a waiting test fails."""


def ticks(first: int, count: int, *, armed: bool = True) -> Record:
    """Return ticks whose numbers hardly compress."""
    made = level_ticks(first, count, armed=armed)
    made["state"]["position_w"] = np.random.default_rng(first).normal(size=(count, 3))
    return made


class Vehicle:
    """Log that is written at once and not by its thread, and its files, in the wire format."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.start()

    def start(self) -> None:
        """Start again, as after a crash: the files are known only from the disk."""
        self.log = OnboardLog(
            self.folder,
            "quad1",
            {"parameters.json": lambda: b"{}"},
            lambda *_: None,
            free=lambda _: 10**10,
        )
        self.files = OnboardFiles(
            self.log.folder,
            self.log.files,
            free=lambda _: 10**10,
            repair=lambda: self.log.repair.state,
        )

    def fly(self, first: int, count: int, *, late_ns: int = 1_000_000) -> None:
        starts = range(first, first + count, BATCH)
        parts = [ticks(start, min(BATCH, first + count - start)) for start in starts]
        batches = [Batch(part, int(part["imu"]["stamp_ns"][-1]) + late_ns) for part in parts]
        for number in range(0, len(batches), 3):  # as many as arrive until the next check
            self.log._store(batches[number : number + 3])

    def event(self, number: int) -> None:
        stamp_ns = START_NS + STEP_NS * number
        self.log._store([Message("events", "rcl_interfaces/Log", b"\0" * 40, stamp_ns, stamp_ns)])

    def land(self) -> None:
        self.log._finish()

    def crash(self) -> None:
        """Leave the writer's file as it is; its lock is released with the process."""
        file = self.log._file
        assert file is not None
        file._sync.end()
        file._writer._file.close()
        self.start()

    def ask(self, service: str, **fields: object) -> Any:
        kind = SERVICES[service]
        answer: Callable[[Any], Any] = getattr(self.files, service.removeprefix("onboard_"))
        request = decode(encode(new(f"{kind}_Request", **fields)), f"{kind}_Request")
        return decode(encode(answering(kind, answer)(request)), f"{kind}_Response")

    def fetch(self, name: str, begin: int, end: int) -> bytes:
        data = bytearray()
        while begin + len(data) < end:
            length = min(PART_BYTES, end - begin - len(data))
            answer = self.ask("onboard_part", name=name, offset=begin + len(data), length=length)
            assert answer.accepted, answer.reason
            assert zlib.crc32(answer.data) == answer.crc32
            data += answer.data.tobytes()
        return bytes(data)

    def name(self) -> str:
        (only,) = self.ask("onboard_files").files
        return str(only.name)


@pytest.fixture
def vehicle(tmp_path: Path) -> Iterator[Vehicle]:
    made = Vehicle(tmp_path)
    yield made
    made.land()


def test_a_file_comes_over_byte_by_byte_with_its_checksum(vehicle: Vehicle) -> None:
    vehicle.fly(0, 1000)
    vehicle.land()
    (file,) = vehicle.ask("onboard_files").files
    path = vehicle.log.folder / file.name
    assert (file.size, file.closed, file.recovered) == (path.stat().st_size, True, False)
    assert file.start_ns - START_NS == pytest.approx(4 * STEP_NS + 1_000_000)
    assert file.end_ns == START_NS + 999 * STEP_NS + 1_000_000
    assert vehicle.fetch(file.name, 0, file.size) == path.read_bytes()
    end = time.monotonic() + BOUND
    while not (digest := vehicle.ask("onboard_part", name=file.name).sha256.tobytes()):
        assert time.monotonic() < end
    assert digest == hashlib.sha256(path.read_bytes()).digest()


def test_a_file_keeps_its_identity_while_it_grows_and_is_closed(vehicle: Vehicle) -> None:
    vehicle.fly(0, 500)
    (begun,) = vehicle.ask("onboard_files").files
    vehicle.fly(500, 500)
    (grown,) = vehicle.ask("onboard_files").files
    head = vehicle.fetch(grown.name, 0, begun.size)
    vehicle.land()
    (closed,) = vehicle.ask("onboard_files").files
    assert begun.identity == grown.identity == closed.identity
    assert (begun.closed, grown.closed, closed.closed) == (False, False, True)
    assert begun.size < grown.size < closed.size
    assert (vehicle.log.folder / closed.name).read_bytes().startswith(head)
    assert grown.start_ns == START_NS
    assert grown.end_ns > begun.end_ns


def test_a_mended_file_is_another_content(vehicle: Vehicle) -> None:
    vehicle.fly(0, 1000)
    vehicle.crash()
    name = vehicle.name()
    (torn,) = vehicle.ask("onboard_files").files
    assert (torn.closed, torn.start_ns) == (False, 0)
    told = f"{name} was torn, and is repaired once the vehicle is disarmed; ask again later"
    assert vehicle.ask("onboard_part", name=name).reason == told
    list(recover_logs(torn_logs(vehicle.folder)))
    (mended,) = vehicle.ask("onboard_files").files
    assert mended.identity != torn.identity
    assert (mended.closed, mended.recovered) == (True, True)


def test_a_log_torn_in_this_process_is_told_to_be_so(vehicle: Vehicle) -> None:
    vehicle.fly(0, 500)
    name = vehicle.name()
    file = vehicle.log._file
    assert file is not None
    file._writer._broken = StorageError("no space left")
    vehicle.log._finish()
    assert [written.path.name for written in vehicle.log.files()] == [name], "it is known still"
    (torn,) = vehicle.ask("onboard_files").files
    assert (torn.closed, torn.start_ns) == (False, 0)
    told = f"{name} was torn, and is repaired once the vehicle is disarmed; ask again later"
    answer = vehicle.ask("onboard_part", name=name)  # as a station requests the reason
    assert (answer.accepted, answer.reason) == (False, told)
    assert vehicle.ask("onboard_part", name=name, length=100).accepted, "its bytes are there"


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"name": "other.mcap", "length": 10}, "there is no onboard log 'other.mcap'"),
        ({"name": "../secret.mcap", "length": 10}, "there is no onboard log '../secret.mcap'"),
        ({"name": "link.mcap", "length": 10}, "there is no onboard log 'link.mcap'"),
        ({"name": "folder.mcap", "length": 10}, "folder.mcap is not a file"),
        ({"name": "notes.txt", "length": 10}, "there is no onboard log 'notes.txt'"),
        ({"name": "", "length": 10}, "there is no onboard log ''"),
        ({"length": PART_BYTES + 1}, "2801 bytes at once are too many; allowed are 2800"),
        ({"length": 10, "offset": 10**9}, "none from 1000000000 on"),
    ],
)
def test_a_part_that_is_none_is_refused_with_its_reason(
    vehicle: Vehicle, fields: dict[str, object], reason: str
) -> None:
    vehicle.fly(0, 100)
    vehicle.land()
    name = vehicle.name()
    (vehicle.folder / "secret.mcap").write_bytes(b"x" * 100)
    (vehicle.log.folder / "notes.txt").write_bytes(b"x" * 100)
    (vehicle.log.folder / "link.mcap").symlink_to(vehicle.folder / "secret.mcap")
    (vehicle.log.folder / "folder.mcap").mkdir()
    answer = vehicle.ask("onboard_part", **({"name": name} | fields))
    assert not answer.accepted
    assert reason in answer.reason


def test_a_file_that_is_removed_during_its_download_is_said(vehicle: Vehicle) -> None:
    vehicle.fly(0, 500)
    vehicle.land()
    name = vehicle.name()
    size = (vehicle.log.folder / name).stat().st_size
    assert vehicle.ask("onboard_part", name=name, offset=size, length=9).data.size == 0
    (vehicle.log.folder / name).unlink()
    answer = vehicle.ask("onboard_part", name=name, offset=100, length=10)
    assert "it may have been removed to make room" in answer.reason


def test_files_that_are_no_logs_are_not_listed(vehicle: Vehicle) -> None:
    assert list(vehicle.ask("onboard_files").files) == [], "nor a folder that is not there"
    vehicle.fly(0, 10)
    magic = b"\x89MCAP0\r\n"
    (vehicle.log.folder / "foreign.mcap").write_bytes(magic + b"no index" * 9 + magic)
    (vehicle.log.folder / "text.mcap").write_text("not a log at all")
    (vehicle.log.folder / "empty.mcap").touch()
    assert vehicle.ask("onboard_part", name="text.mcap", length=9).reason.endswith(
        "is not an MCAP log"
    )
    answer = vehicle.ask("onboard_files")
    assert [file.name for file in answer.files] == [vehicle.log.files()[0].path.name]
    assert answer.free_bytes == 10**10


def test_a_name_that_is_used_again_is_another_content(vehicle: Vehicle) -> None:
    vehicle.fly(0, 10)
    vehicle.land()
    (first,) = vehicle.ask("onboard_files").files
    path = vehicle.log.folder / first.name
    content = path.read_bytes()
    path.unlink()  # its inode is free now
    path.write_bytes(content)
    (second,) = vehicle.ask("onboard_files").files
    assert second.identity != first.identity


def test_a_disk_that_cannot_be_read_is_a_reason(
    vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    vehicle.fly(0, 100)
    vehicle.land()
    name = vehicle.name()

    def failing(*arguments: object) -> bytes:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "pread", failing)
    answer = vehicle.ask("onboard_part", name=name, length=10)
    assert answer.reason == f"cannot read {name}: Input/output error"
    with pytest.raises(StorageError):
        vehicle.files.part(new("quadlab_msgs/srv/OnboardPart_Request", name=name, length=10))
