"""`quadlab vehicle`'s word `--serial`: which ports it means, and looking at what is behind them."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from quadrotor.errors import UsageError

AUTO = "auto"
MOST = 2


def split_ports(words: Sequence[str]) -> list[str]:
    """Separate words and commas alike; a device that has a comma in its name is left whole."""
    ports: list[str] = []
    for word in words:
        parts = [word] if os.path.exists(word) else word.split(",")
        ports += [part.strip() for part in parts if part.strip()]
    return ports


def flight_ports(words: Sequence[str]) -> list[str]:
    """The ports to fly with; `auto` looks for them behind all devices.

    Raises UsageError when they are not one or two, LinkError when none fits.
    """
    named = split_ports(words)
    if AUTO in named:
        from vehicle.microcontroller import FIRMWARE_REVISION, ROBOT_ID
        from vehicle_link.serial.devices import find_ports

        patterns = [word for word in named if word != AUTO]
        ports = find_ports(patterns, robot_id=ROBOT_ID, firmware=FIRMWARE_REVISION, say=_say)
        _say(f"microcontroller of robot {ROBOT_ID} at {' and '.join(ports)}")
        return ports
    if not 1 <= len(named) <= MOST:
        raise UsageError(
            f"--serial has {len(named)} ports; allowed are one or two, like "
            "--serial /dev/ttyUSB0,/dev/ttyUSB1, or --serial auto; "
            "`quadlab vehicle --find` lists what there is"
        )
    if len({os.path.realpath(port) for port in named}) < len(named):
        raise UsageError(f"--serial {','.join(named)} is one device twice; give the other port")
    return named


def check(words: Sequence[str]) -> int:
    """`--check`: exit status 0 when the connection is good, else 1."""
    from vehicle.serial_check import check_connection

    return 0 if check_connection(flight_ports(words), say=_print) else 1


def find(words: Sequence[str]) -> int:
    """`--find`: a line for each device; exit status 0 when one fits, else 1."""
    from vehicle.microcontroller import FIRMWARE_REVISION, ROBOT_ID
    from vehicle_link.serial.devices import candidates, choose_ports, controllers
    from vehicle_link.serial.discovery import discover

    paths = candidates(word for word in split_ports(words) if word != AUTO)
    devices = discover(paths, robot_id=ROBOT_ID, firmware=FIRMWARE_REVISION)
    for device in devices:
        _print(device.line)
    for group in controllers(devices):
        if len(group) > 1:
            _print(f"ports of one microcontroller: {', '.join(device.path for device in group)}")
    ports = choose_ports(devices, ROBOT_ID, FIRMWARE_REVISION)
    _print(f"fly with: --serial {','.join(ports)}")
    return 0


def _print(line: str) -> None:
    print(line, flush=True)


def _say(line: str) -> None:
    print(f"vehicle: {line}", file=sys.stderr, flush=True)
