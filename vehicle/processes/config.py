"""The configuration that the vehicle's parent process passes to its children, and their rings."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from quadrotor.parameter_description import ParameterValue
from quadrotor.records import BEARINGS_SAMPLE, JUDGED_READING, POSE_SAMPLE, TICK
from vehicle.boards.kind import MIKROKOPTER
from vehicle.processes.rings import ByteRing, RecordRing, create
from vehicle_link.addresses import EVERYWHERE
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.serial.capacity import DEFAULT_RATE

TICK_SLOTS = 4096  # 8 s at 500 Hz, 4 s at 1000 Hz: longer than a restart of comms
INBOX_SLOTS, INBOX_SLOT_SIZE = 256, 8192
MEASUREMENT_SLOTS = 256
READING_SLOTS = 4096
OUTBOX_SLOTS, OUTBOX_SLOT_SIZE = 256, 16384  # a reply may quote a whole command


class RingDescriptors(msgspec.Struct, frozen=True):
    """File descriptors of the rings, the same numbers in every process."""

    ticks: int  # TICK records, flight to comms
    inbox: int  # mailbox.Inbound, comms to flight
    poses: int  # POSE_SAMPLE records, comms to flight
    bearings: int  # BEARINGS_SAMPLE records without places, comms to flight
    outbox: int  # mailbox.Outbound, flight to comms
    readings: int  # JUDGED_READING records, flight to comms

    @property
    def all(self) -> tuple[int, ...]:
        return self.ticks, self.inbox, self.poses, self.bearings, self.outbox, self.readings


GIVEN_UP = 3  # exit status of a comms process that cannot work with its configuration
DEAF = 4  # exit status of a comms process that no command can reach any more
TRAJECTORIES, PLUGINS = "trajectories", "plugins"
"""Names of the folders, in the data folder, of the user's trajectory files and plugins."""
PACKETS_A_SECOND, FEWEST_PACKETS = 100, 12
"""Usual and lowest rate of telemetry packets; several vehicles on one computer send fewer."""


class VehicleConfig(msgspec.Struct, frozen=True, kw_only=True):
    """Argument of `python -m vehicle.flight.process` and of `python -m vehicle.comms.process`."""

    parent: int  # process id
    rings: RingDescriptors
    name: str = "quad1"
    data: str = ""  # folder; none in flight without trajectories and plugins
    parameters: dict[str, ParameterValue] = {}  # set before the start
    identity: Identity = THE_ONE
    # Of the flight process:
    ports: list[str] = []  # of the microcontroller; none: a simulated vehicle in this process
    rate: int = DEFAULT_RATE  # Hz
    board: str = MIKROKOPTER
    board_options: dict[str, ParameterValue] = {}  # of this kind of board, set before the start
    # Of the comms process:
    link_host: str = EVERYWHERE  # address to listen on for the station
    link_port: int = 0
    started_ns: int = 0  # start of the vehicle; comms may be restarted later
    refused_calibrations: list[int] = []  # stamps (ns) of records that do not apply
    notices: list[tuple[int, str]] = []  # (level, text) of events at the start
    packets: int = PACKETS_A_SECOND  # telemetry packets a second
    line_ns: int = 0  # time of a sample on the line, from its stamp on
    instance: int = 0  # of the vehicle's parent process; unchanged by a restart of comms


@dataclass(frozen=True, slots=True)
class Rings:
    """The rings as this process maps them."""

    ticks: RecordRing
    inbox: ByteRing
    poses: RecordRing
    bearings: RecordRing
    outbox: ByteRing
    readings: RecordRing


def create_rings() -> RingDescriptors:
    """Create the shared memory, once per vehicle process."""
    return RingDescriptors(
        ticks=create(TICK_SLOTS, TICK.itemsize, "ticks"),
        inbox=create(INBOX_SLOTS, INBOX_SLOT_SIZE, "inbox"),
        poses=create(MEASUREMENT_SLOTS, POSE_SAMPLE.itemsize, "poses"),
        bearings=create(MEASUREMENT_SLOTS, BEARINGS_SAMPLE.itemsize, "bearings"),
        outbox=create(OUTBOX_SLOTS, OUTBOX_SLOT_SIZE, "outbox"),
        readings=create(READING_SLOTS, JUDGED_READING.itemsize, "readings"),
    )


def open_rings(descriptors: RingDescriptors) -> Rings:
    """Map the rings into this process."""
    return Rings(
        ticks=RecordRing(descriptors.ticks, TICK, TICK_SLOTS),
        inbox=ByteRing(descriptors.inbox, INBOX_SLOTS, INBOX_SLOT_SIZE),
        poses=RecordRing(descriptors.poses, POSE_SAMPLE, MEASUREMENT_SLOTS),
        bearings=RecordRing(descriptors.bearings, BEARINGS_SAMPLE, MEASUREMENT_SLOTS),
        outbox=ByteRing(descriptors.outbox, OUTBOX_SLOTS, OUTBOX_SLOT_SIZE),
        readings=RecordRing(descriptors.readings, JUDGED_READING, READING_SLOTS),
    )
