"""`quadlab vehicle`'s option `--serial`: the ports that it means, and the search behind them."""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from quadrotor.errors import LinkError, UsageError
from vehicle.boards.kind import find_kind
from vehicle.processes.terminal import say
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.serial.capacity import DEFAULT_RATE, check_rate, default_rate, samples_a_second
from vehicle_link.serial.links import is_link, open_port
from vehicle_link.serial.serial_port import NO_DEVICE

if TYPE_CHECKING:
    from quadrotor.parameter_description import ParameterValue

AUTO = "auto"
MAX_PORTS = 2


def split_ports(words: Sequence[str]) -> list[str]:
    """Split at words and commas; a device with a comma in its name stays whole."""
    ports: list[str] = []
    for word in words:
        parts = [word] if os.path.exists(word) else word.split(",")
        ports += [part.strip() for part in parts if part.strip()]
    return ports


def flight_ports(words: Sequence[str], identity: Identity = THE_ONE) -> list[str]:
    """Return the ports to fly with; `auto` searches for them behind all devices.

    Raises UsageError when they are not one or two, LinkError when none fits.
    """
    named = split_ports(words)
    if AUTO in named:
        from vehicle_link.serial.devices import find_ports

        patterns = [word for word in named if word != AUTO]
        ports = find_ports(
            patterns, robot_id=identity.robot_id, firmware=identity.firmware, say=say
        )
        say(f"microcontroller of robot {identity.robot_id} at {' and '.join(ports)}")
        return ports
    if not 1 <= len(named) <= MAX_PORTS:
        raise UsageError(
            f"--serial has {len(named)} ports; allowed are one or two, like "
            "--serial /dev/ttyUSB0,/dev/ttyUSB1, or --serial auto; "
            "`quadlab vehicle --find` lists what there is"
        )
    if len({os.path.realpath(port) for port in named}) < len(named):
        raise UsageError(f"--serial {','.join(named)} is one device twice; give the other port")
    return [os.path.abspath(port) for port in named]  # the flight process runs in another folder


def ports_at_rate(
    words: Sequence[str], rate: int | None, *, in_process: bool, identity: Identity = THE_ONE
) -> tuple[list[str], int]:
    """Return the ports to fly with, none when the vehicle is simulated in process; and the rate in
    Hz.

    Args:
        rate: in Hz; None for what the ports can carry.

    Raises UsageError when they cannot carry it, LinkError when one is a file or a folder, and as
    `flight_ports`.
    """
    if rate is not None:
        check_rate(rate, None)
    if in_process:
        if words:
            raise UsageError(
                f"--in-process flies a simulated vehicle without ports, and --serial has "
                f"{','.join(words)}; leave one of the two out"
            )
        return [], DEFAULT_RATE if rate is None else rate
    if rate is not None and rate > samples_a_second(MAX_PORTS):
        check_rate(rate, MAX_PORTS)  # fails with any ports, so they need not be searched for
    ports = flight_ports(words, identity)
    for port in ports:
        if os.path.exists(port) and not stat.S_ISCHR(os.stat(port).st_mode):
            # Fail early: the flight process would open it only seconds later.
            raise LinkError(f"serial port {port} cannot be opened: {NO_DEVICE}")
    if rate is None:
        return ports, default_rate(len(ports))
    check_rate(rate, len(ports))
    return ports, rate


def check(words: Sequence[str], identity: Identity = THE_ONE) -> int:
    """Run `--check`: return exit status 0 when the connection is good, else 1."""
    from vehicle.boards.mikrokopter.serial_check import check_connection

    return (
        0 if check_connection(flight_ports(words, identity), identity=identity, say=_print) else 1
    )


def ports_of_board(board: str, words: Sequence[str], rate: int | None) -> tuple[list[str], int]:
    """Return the ports with which to fly another board, and the rate in Hz.

    Raises UsageError for an unknown board, and for more ports than it has.
    """
    kind, named = find_kind(board), split_ports(words)
    if not 1 <= len(named) <= len(kind.bauds):
        most = len(kind.bauds)
        has = "has 1" if most == 1 else f"has 1 to {most}"
        raise UsageError(
            f"--serial has {len(named)} ports; --board {board} {has}, like --serial {kind.example}"
        )
    _check_links(board, named)
    if rate is not None:
        check_rate(rate, None)
    ports = [port if is_link(port) else os.path.abspath(port) for port in named]
    return ports, rate or kind.rate


def _check_links(board: str, named: Sequence[str]) -> None:
    """Check that a board behind a link is not given a device. Raises UsageError."""
    example = find_kind(board).example
    for port in named:
        if is_link(example) and not is_link(port):
            raise UsageError(
                f"--serial {port} is a device; --board {board} is behind a link, like {example}"
            )


def check_other_board(
    board: str, words: Sequence[str], values: Mapping[str, ParameterValue]
) -> int:
    """Run `--board NAME --check`: return exit status 0 when the board fits, else 1.

    Args:
        values: of its options.

    Raises UsageError for a board that cannot be checked; LinkError when the port cannot be opened
    or does not answer.
    """
    kind = find_kind(board)
    if kind.check is None:
        raise UsageError(f"--board {board} has no --check")
    named = split_ports(words)
    if len(named) != 1:
        raise UsageError(
            f"--serial has {len(named)} ports; --board {board} --check reads one, like "
            f"--serial {kind.example.partition(',')[0]}"
        )
    _check_links(board, named)
    port = open_port(named[0], kind.bauds[0])
    try:
        return 1 if kind.check(port, kind.configured(values), _print) else 0
    finally:
        port.close()


def find(words: Sequence[str], identity: Identity = THE_ONE) -> int:
    """Run `--find`: print a line for each device; return exit status 0 when one fits, else 1."""
    from vehicle_link.serial.devices import candidates, choose_ports, controllers
    from vehicle_link.serial.discovery import discover

    paths = candidates(word for word in split_ports(words) if word != AUTO)
    devices = discover(paths, robot_id=identity.robot_id, firmware=identity.firmware)
    for device in devices:
        _print(device.line)
    for group in controllers(devices):
        if len(group) > 1:
            _print(f"ports of one microcontroller: {', '.join(device.path for device in group)}")
    ports = choose_ports(devices, identity.robot_id, identity.firmware)
    _print(f"fly with: --serial {','.join(ports)}{_other_words(identity)}")
    return 0


def _other_words(identity: Identity) -> str:
    """Return the options that select this microcontroller, unless it is the default one."""
    words = ""
    if identity.robot_id != THE_ONE.robot_id:
        words += f" --robot-id {identity.robot_id}"
    if identity.firmware != THE_ONE.firmware:
        words += f" --firmware {identity.firmware}"
    return words


def _print(line: str) -> None:
    print(line, flush=True)
