"""Hostile bytes for the parsers of streams and datagrams: mutated valid frames, and noise.

    python -m benchmarks hostile_bytes [--quick | --smoke] [--seed N]

Each door gets its bytes in this process, from its own seed. What counts as *obeyed* must never
happen: a command of a ground station that does not sign, a datagram with a forged seal. A line
with a checksum has no secret, and some of the frames pass: there only errors and time count.
"""

from __future__ import annotations

import io
import random
import socket
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from benchmarks.harness import Report, Row, Size, Target, free_port
from extensions.betaflight.msp.frames import MessageDecoder
from extensions.betaflight.msp.frames import encode as encode_msp
from extensions.crazyflie.crtp import packets as crtp
from extensions.fmu.parameters import check_size, declared_by, kind_of
from extensions.mavlink.dialect import mavlink
from extensions.mavlink.peer import Peer
from extensions.mocap.udp import parse as parse_bodies
from quadrotor.errors import QuadlabError
from quadrotor.motor_state import MotorState
from vehicle.laws.contract import LAW
from vehicle.plugins.links import UdpLink
from vehicle.simulator.firmware.firmware import Firmware
from vehicle_link import messages
from vehicle_link.lane.datagram import Opener, Refused, Sealer, key_id_of
from vehicle_link.serial import commands
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.topics import control_inputs, measurements
from vehicle_link.transport.publisher import Received

BYTES = 1_000_000, 100_000, 10_000
"""Bytes for each door, of each size."""
STALL = 0.05
"""Longest processor time, in s, that one chunk may take."""
KEY_ID, KEY = 7, bytes(range(32))
Take = Callable[[bytes], int]
"""Takes one chunk; returns how often it was obeyed."""


@dataclass
class Door:
    """One parser.

    Attributes:
        valid: some frames that it would accept, to be mutated.
        opened: makes a parser as at the start of a connection.
    """

    name: str
    valid: Sequence[bytes]
    opened: Callable[[], Take]


@dataclass
class Attack:
    """The count of what a door did with its bytes; `stall` in s of the processor."""

    chunks: int = 0
    refused: int = 0
    obeyed: int = 0
    crashed: list[str] = field(default_factory=list)
    stall: float = 0.0


def attack(door: Door, count: int, seed: int) -> Attack:
    """Give a door at least `count` bytes."""
    generator, found, take, sent = random.Random(f"{seed} {door.name}"), Attack(), door.opened(), 0
    while sent < count:
        data = chunk(generator, door.valid)
        sent += len(data)
        found.chunks += 1
        began = time.thread_time()
        try:
            found.obeyed += take(data)
        except QuadlabError:
            found.refused += 1
        except Exception as error:
            found.crashed.append(f"{type(error).__name__}: {error}")
            take = door.opened()
        found.stall = max(found.stall, time.thread_time() - began)
    return found


def chunk(generator: random.Random, valid: Sequence[bytes]) -> bytes:
    """Return noise, or valid frames of which one is damaged, cut, or repeated in part."""
    kind = generator.randrange(4)
    if kind == 0:
        return generator.randbytes(generator.randrange(1, 300))
    data = bytearray(generator.choice(valid))
    if kind == 1:
        for _ in range(generator.randrange(1, 4)):
            data[generator.randrange(len(data))] ^= 1 << generator.randrange(8)
    elif kind == 2:
        del data[generator.randrange(len(data)) :]
        data += generator.randbytes(generator.randrange(1, 9))
    else:
        at, length = generator.randrange(len(data)), generator.randrange(1, 40)
        data[at:at] = generator.randbytes(length)
    return bytes(data)


# ---------------------------------------------------------------- the doors
def microcontroller() -> Take:
    firmware, ms = Firmware(), 0
    firmware.period(firmware.command)  # compiled before time counts

    def take(data: bytes) -> int:
        nonlocal ms
        ms += 2
        firmware.advance(ms)
        firmware.receive(0, data)
        firmware.period(firmware.command)
        return 0

    return take


def samples() -> Take:
    decoder = FrameDecoder()

    def take(data: bytes) -> int:
        for frame in decoder.feed(data):
            commands.decode_data(frame)
        return 0

    return take


def msp() -> Take:
    decoder = MessageDecoder()
    return lambda data: 0 * len(list(decoder.feed(data)))


def radio() -> Take:
    reader = crtp.FrameReader()
    return lambda data: 0 * len([crtp.decode(packet) for packet in reader.feed(data)])


def ground_station(kind: socket.SocketKind, key: bytes) -> Take:
    peer = Peer(socket.socket(socket.AF_INET, kind), ("127.0.0.1", 9), key, is_fixed=False)

    def take(data: bytes) -> int:
        if not peer.begins(data):
            return 0
        messages = peer.parse(data)
        moving = [m for m in messages if m.get_type() in ("COMMAND_LONG", "COMMAND_INT")]
        return len(moving) if peer.may_command else 0

    return take


def lane() -> Take:
    opener = Opener(KEY, ("telemetry",), Refused())

    def take(data: bytes) -> int:
        return int(key_id_of(data) == KEY_ID and opener.open(data) is not None)

    return take


def bodies() -> Take:
    return lambda data: 0 * len(parse_bodies(data, 0).bodies)


def told_by_a_node(decode: Callable[[bytes], object]) -> Take:
    return lambda data: 0 * bool(decode(data))


def fmu() -> Take:
    folder = tempfile.TemporaryDirectory(prefix="quadlab-fmu-")
    path = Path(folder.name, "one.fmu")

    def take(data: bytes) -> int:
        path.write_bytes(data)
        kind_of(path)
        check_size(path)
        declared_by(path)
        return 0 * len(folder.name)

    return take


def answers_of_a_stranger() -> Take:
    stranger, peer = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    stranger.bind(("127.0.0.1", 0))
    peer.bind(("127.0.0.1", 0))
    port = free_port()
    link = UdpLink(LAW, "law", f"127.0.0.1:{peer.getsockname()[1]}", port, waits=False)

    def take(data: bytes) -> int:
        stranger.sendto(data, ("127.0.0.1", port))
        return int(link.receive() is not None and bool(peer))

    return take


def node_doors() -> list[Door]:
    """Return the doors for messages that any ROS 2 node on this computer may send."""
    header, unit = messages.header(1), [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8]]
    reference = messages.encode(messages.new("quadlab_msgs/Reference", header=header))
    upright = messages.new(
        "geometry_msgs/Pose", orientation=messages.new("geometry_msgs/Quaternion", w=1.0)
    )
    pose = messages.encode(messages.new("geometry_msgs/PoseStamped", header=header, pose=upright))
    place = messages.encode(messages.new("geometry_msgs/PointStamped", header=header))
    found: dict[str, tuple[bytes, Callable[[bytes], object]]] = {
        "joy": (control_inputs.encode_joy(1, (0, 0, 0, 0), True), control_inputs.decode_joy),
        "external_reference": (reference, control_inputs.decode_external_reference),
        "station_heartbeat": (
            control_inputs.encode_heartbeat(1, 1, 1, 1),
            control_inputs.decode_heartbeat,
        ),
        "tracker_pose": (pose, measurements.decode_pose),
        "tracker_position": (place, measurements.decode_position),
        "bearings": (
            measurements.encode_bearings(1, [1, 2], unit, 0.01),
            measurements.decode_bearings,
        ),
        "picture": (
            measurements.encode_picture(1, measurements.JPEG, "camera"),
            measurements.decode_picture,
        ),
    }
    return [
        Door(f"ROS 2, {topic}", [valid], partial(told_by_a_node, decode))
        for topic, (valid, decode) in found.items()
    ]


def archive() -> bytes:
    """Return an FMU with two parameters and no code."""
    kind = 'causality="parameter" variability="tunable"'
    variable = (
        f'<ScalarVariable name="{{}}" valueReference="{{}}" {kind}>'
        '<Real start="1.5" min="0" max="9" unit="s"/></ScalarVariable>'
    )
    inside = "".join(variable.format(name, k) for k, name in enumerate(("gain", "a[1].b")))
    text = f"<fmiModelDescription><ModelVariables>{inside}</ModelVariables></fmiModelDescription>"
    with io.BytesIO() as file:
        with zipfile.ZipFile(file, "w") as made:
            made.writestr("modelDescription.xml", text)
        return file.getvalue()


def doors() -> list[Door]:
    """Return all doors that are attacked here."""
    mav = mavlink.MAVLink(None, 255, 190)
    arm = mav.command_long_encode(1, 1, 400, 0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    beat = mav.heartbeat_encode(6, 8, 0, 0, 4)
    told = [bytes(message.pack(mav)) for message in (arm, beat)]
    stopped = (0, 0, 0, 0)
    to_board = [
        commands.encode_set(stopped, 32, MotorState.ON),
        commands.encode_command((40, 40, 40, 40)),
        commands.encode_mirror(stopped, list(range(10))),
    ]
    packets = [crtp.frame(crtp.Packet(3, 0, bytes(14)).encode()), crtp.frame(b"\xff")]
    sealed = Sealer(KEY_ID, KEY)
    datagrams = [
        sealed.seal("telemetry", Received(bytes(200), k, 1, 1, bytes(16))) for k in range(20)
    ]
    stream, datagram = socket.SOCK_STREAM, socket.SOCK_DGRAM
    return [
        Door("serial line, to the microcontroller", to_board, microcontroller),
        Door("serial line, to the vehicle", [commands.encode_data(bytes(20))], samples),
        Door("MSP of Betaflight", [encode_msp(101), encode_msp(200, bytes(16))], msp),
        Door("CRTP of a Crazyflie", packets, radio),
        Door("MAVLink over TCP, not signed", told, lambda: ground_station(stream, b"")),
        Door("MAVLink over TCP, signed", told, lambda: ground_station(stream, KEY)),
        Door("MAVLink over UDP, not signed", told, lambda: ground_station(datagram, b"")),
        Door("MAVLink over UDP, signed", told, lambda: ground_station(datagram, KEY)),
        Door("telemetry of the lane", datagrams, lane),
        Door("tracker, UDP", [b"12.5,quad1,1,2,3,1,0,0,0\n", b",a,1,2,3\n"], bodies),
        Door("law over UDP, not its peer", [bytes(LAW.outputs.itemsize)], answers_of_a_stranger),
        Door("FMU", [archive()], fmu),
        *node_doors(),
    ]


def run(size: Size = Size.FULL, seed: int = 1) -> Report:
    """Attack every door."""
    count = size.of(*BYTES)
    report = Report(
        "hostile_bytes",
        "Hostile bytes at the parsers",
        [f"{count:,} bytes for each, seed {seed}: mutated valid frames, and noise"],
    )
    attacks = {door.name: attack(door, count, seed) for door in doors()}
    for name, found in attacks.items():
        report.rows.append(
            Row(
                name,
                {
                    "chunks": found.chunks,
                    "refused": found.refused,
                    "obeyed": found.obeyed,
                    "crashed": len(found.crashed),
                    "longest stall, ms": 1e3 * found.stall,
                },
            )
        )
        report.notes += [f"{name}: {found.crashed[0]}"] if found.crashed else []
    worst = max(found.stall for found in attacks.values())
    report.targets = [
        Target("obeyed", sum(found.obeyed for found in attacks.values()), 0),
        Target("crashed", sum(len(found.crashed) for found in attacks.values()), 0),
        Target("longest stall, s", worst, STALL),
    ]
    return report
