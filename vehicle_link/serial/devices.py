"""The search, among serial devices, for the ports of the one microcontroller that is to fly."""

from __future__ import annotations

import glob
import os
import time
from collections.abc import Callable, Iterable, Sequence

from serial.tools import list_ports

from quadrotor.errors import LinkError
from vehicle_link.serial.discovery import Device, Finding, discover

PATIENCE_S = 10.0
PAUSE_S = 0.1
WORTH_WAITING = frozenset(
    {Finding.MISSING, Finding.BUSY, Finding.SILENT, Finding.DEAF, Finding.FAILED, Finding.UNPLUGGED}
)
"""Findings that plugging in, switching on or ending another program may resolve in the meantime."""

ANSWERED = frozenset({Finding.FOUND, Finding.OTHER_ROBOT, Finding.OTHER_FIRMWARE})


def candidates(patterns: Iterable[str] = ()) -> list[str]:
    """Return the paths to check: the given ones (globs expanded), then this machine's serial
    devices.

    One device under several names is listed once; a path that does not exist stays in the list.
    """
    paths: list[str] = []
    for pattern in patterns:
        paths += sorted(glob.glob(pattern)) or [pattern]
    paths += sorted(port.device for port in list_ports.comports())
    once: dict[str, str] = {}
    for path in paths:
        once.setdefault(os.path.realpath(path), path)
    return list(once.values())


def await_devices(
    paths: Sequence[str],
    *,
    robot_id: int,
    firmware: int,
    patience_s: float = PATIENCE_S,
    say: Callable[[str], None] = lambda line: None,
) -> list[Device]:
    """Find what is behind these devices; repeat for the promising ones until `patience_s` is
    over.
    """
    deadline_s = time.monotonic() + patience_s
    found: dict[str, Device] = {}
    waited = False
    while True:
        # A device that has just appeared may not have its group yet.
        again = [
            path
            for path in paths
            if path not in found
            or found[path].finding in WORTH_WAITING
            or (waited and found[path].finding is Finding.FORBIDDEN)
        ]
        devices = discover(again, robot_id=robot_id, firmware=firmware)
        found.update((device.path, device) for device in devices)
        wanting = [device for device in devices if device.finding in WORTH_WAITING]
        if not wanting or time.monotonic() >= deadline_s:
            return [found[path] for path in paths]
        if not waited:
            for device in wanting:
                say(f"{device.line}; trying for {patience_s:.0f} s")
        waited = True
        time.sleep(PAUSE_S)


def controllers(devices: Iterable[Device]) -> list[list[Device]]:
    """Return the devices that answered, one list for each microcontroller."""
    groups: list[list[Device]] = []
    for device in devices:
        if device.finding in ANSWERED:
            for group in groups:
                if device.is_of(group[0]):
                    group.append(device)
                    break
            else:
                groups.append([device])
    return groups


def choose_ports(devices: Sequence[Device], robot_id: int, firmware: int) -> list[str]:
    """Return the one or two ports of the one microcontroller that fits.

    Raises LinkError when there is none, or more than one.
    """
    fitting = [device for device in devices if device.finding is Finding.FOUND]
    groups = controllers(fitting)
    if not groups:
        raise LinkError(
            f"no microcontroller of robot {robot_id} with firmware {firmware} behind "
            f"{len(devices)} serial device{'s' * (len(devices) != 1)}; plug it in and switch it "
            "on, or name its ports with --serial"
        )
    if len(groups) > 1:
        named = " and ".join(",".join(device.path for device in group) for group in groups)
        raise LinkError(
            f"{len(groups)} microcontrollers call themselves robot {robot_id}: {named}; "
            "name the ports of one with --serial"
        )
    ports = [device.path for device in groups[0]]
    if len(ports) > 2:
        raise LinkError(
            f"{len(ports)} ports could belong to one microcontroller: {', '.join(ports)}; "
            "name two of them with --serial"
        )
    return ports


def find_ports(
    patterns: Iterable[str],
    *,
    robot_id: int,
    firmware: int,
    patience_s: float = PATIENCE_S,
    say: Callable[[str], None] = lambda line: None,
) -> list[str]:
    """Return the ports of the one microcontroller that fits, behind any device of this machine.

    Searches until `patience_s` is over; then reports through `say` what was behind each device.

    Raises LinkError when there is none, or more than one.
    """
    patterns = tuple(patterns)
    deadline_s = time.monotonic() + patience_s
    while True:
        devices = discover(candidates(patterns), robot_id=robot_id, firmware=firmware)
        fits = any(device.finding is Finding.FOUND for device in devices)
        if fits or time.monotonic() >= deadline_s:
            break
        time.sleep(PAUSE_S)
    try:
        return choose_ports(devices, robot_id, firmware)
    except LinkError:
        for device in devices:
            say(device.line)
        raise
