"""Input from elsewhere may be nested without end: each reader refuses it in one line."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from console.link.known_vehicles import FILE, KnownVehicles
from extensions.foxglove.protocol import parse_text
from extensions.importers.mapping import load_mapping
from extensions.importers.readers.formats import open_source
from extensions.importers.sweeps import read_stations
from quadrotor.calibration_record import parse_record
from quadrotor.errors import QuadlabError
from vehicle.plugins.declared import declared
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_descriptor
from web.live.telemetry import parse_request
from web.parameters.file import read_file
from web.view.proxy import HostileError, _read

NEST = "[" * 20_000 + "]" * 20_000


def ulog() -> bytes:
    """Return a log of 54 bytes whose format x contains itself."""
    body = b"x:uint64_t timestamp;x x;"
    subscribed = struct.pack("<BH", 0, 0) + b"x"
    head = b"ULog\x01\x12\x35\x01" + bytes(8)
    messages = ((b"F", body), (b"A", subscribed), (b"D", struct.pack("<HQ", 0, 1)))
    return head + b"".join(struct.pack("<H", len(data)) + kind + data for kind, data in messages)


def npy() -> bytes:
    head = f"{{'descr': {'-' * 9000}1, 'fortran_order': False, 'shape': (1,)}}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


PLUGIN = f"class Mine(Parameters):\n    a: float = parameter({'-' * 20_000}1)\n"
FILES: dict[str, tuple[str, str | bytes, Callable[[Path], object]]] = {
    "mapping": ("m.toml", f"imu = {NEST}", lambda path: load_mapping(str(path))),
    "ulog": ("a.ulg", ulog(), lambda path: open_source(path, ["x"])),
    "numpy": ("a.npy", npy(), lambda path: open_source(path, [])),
    "base stations": ("a.yaml", NEST, read_stations),
    "known vehicles": (FILE, f"quad1 = {NEST}", lambda path: KnownVehicles(path.parent).all()),
    "plugin": ("a.py", PLUGIN, declared),
}


@pytest.mark.parametrize("kind", FILES)
def test_a_file_is_refused_in_one_line(tmp_path: Path, kind: str) -> None:
    name, content, read = FILES[kind]
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(QuadlabError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def descriptor() -> Any:
    return new("rcl_interfaces/ParameterDescriptor", name="x", type=3, additional_constraints=NEST)


def view(key: str) -> bytes:
    head = msgspec.msgpack.encode({"type": "ViewerCameraMessage", key: None})
    return head[:-1] + b"\x91" * 4000 + b"\x01"


MESSAGES: dict[str, tuple[type[Exception], Callable[[], object]]] = {
    "parameter file": (QuadlabError, lambda: read_file(f"a = {NEST}".encode())),
    "calibration": (QuadlabError, lambda: parse_record(NEST)),
    "descriptor": (QuadlabError, lambda: from_descriptor(descriptor())),
    "foxglove": (ValueError, lambda: parse_text(f'{{"op": "subscribe", "x": {NEST}}}')),
    "subscription": (ValueError, lambda: parse_request(f'{{"id": {NEST}}}')),
    "ping": (ValueError, lambda: parse_request(f'{{"ping": {NEST}}}')),
    "view": (HostileError, lambda: _read(view("position"))),
    "view, skipped": (HostileError, lambda: _read(view("other"))),
}


@pytest.mark.parametrize("kind", MESSAGES)
def test_a_message_is_refused_by_its_reader(kind: str) -> None:
    refusal, read = MESSAGES[kind]
    with pytest.raises(refusal):
        read()
