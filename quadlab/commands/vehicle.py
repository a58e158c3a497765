"""The processes on the vehicle's own computer as a command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.data_folder import data_folder, open_data_folder
from quadlab.option_types import Flag, Folder, Settings, optional
from quadlab.settings import (
    check_laws,
    offer_plugins,
    parse_board_options,
    parse_settings,
    vehicle_parameters,
)
from quadlab.up import serial_ports
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.errors import UsageError
from vehicle.boards.kind import MIKROKOPTER
from vehicle_link.identity import THE_ONE, Identity


@dataclass
class Vehicle:
    """Run the vehicle's flight stack on board: flight and comms process."""

    serial: Annotated[tuple[str, ...], optional("PORT[,PORT]")] = ()
    """the microcontroller's serial ports, one or two; auto searches all serial devices; the link
    of a Crazyflie, like radio://0/80/2M/E7E7E7E7E7"""
    check: Flag = False
    """test the connection, print the result and exit"""
    board: str = MIKROKOPTER
    """the flight board: mikrokopter, betaflight, crazyflie, or one of an installed
    package (docs/boards)"""
    find: Flag = False
    """list all serial devices, print what answers on each, and exit"""
    robot_id: Annotated[int, tyro.conf.arg(metavar="ID")] = THE_ONE.robot_id
    """robot id that the microcontroller must report; motors do not start with another one"""
    firmware: Annotated[int, tyro.conf.arg(metavar="REVISION")] = THE_ONE.firmware
    """firmware revision that it must report; motors do not start with another one"""
    data: Folder = None
    """data folder"""
    rate: Annotated[int | None, optional("HZ")] = None
    """IMU samples and ticks per second, 60 to 1000; one port carries 338, two
    carry 677 (default: 500, with one port 300)"""
    in_process: Flag = False
    """instead of --serial: fly a simulated vehicle inside the flight process, at any rate"""
    link_port: int = 7447
    """UDP port of the radio link to listen on; the port after it carries the fast lane"""
    link_host: str = "0.0.0.0"
    """address of the radio link to listen on; the usual one is every one of this computer"""
    telemetry: Annotated[int, tyro.conf.arg(metavar="HZ")] = 100
    """telemetry packets a second, 12 to 100; each holds the ticks since the previous one"""
    name: str = THE_VEHICLE
    """namespace of the vehicle's topics"""
    set: Settings = ()
    """start with this parameter value; board.NAME=VALUE is an option of the board, for --check,
    too"""

    def run(self) -> int:
        check_name(self.name)
        if not 12 <= self.telemetry <= 100:
            raise UsageError(f"--telemetry {self.telemetry} is not possible; allowed are 12 to 100")
        identity = Identity(self.robot_id, self.firmware)
        identity.check()
        if self.find and self.check:
            raise UsageError("--find searches all devices, --check tests two: give one of them")
        words, options = parse_board_options(self.board, self.set)
        if self.board != MIKROKOPTER and self.check:
            return serial_ports.check_other_board(self.board, self.serial, options)
        if self.find:
            return serial_ports.find(self.serial, identity)
        if self.check:
            return serial_ports.check(self.serial, identity)
        if self.board == MIKROKOPTER:
            ports, rate = serial_ports.ports_at_rate(
                self.serial, self.rate, in_process=self.in_process, identity=identity
            )
        else:
            ports, rate = serial_ports.ports_of_board(self.board, self.serial, self.rate)
        from vehicle.processes.parent import run_vehicle

        settings = {}
        if words:
            offer_plugins(data_folder(self.data))
            settings = parse_settings(vehicle_parameters(self.board), words)
        data = open_data_folder(self.data)
        check_laws(settings, data)
        return run_vehicle(
            ports,
            data=data,
            link_port=self.link_port,
            link_host=self.link_host,
            name=self.name,
            settings=settings,
            rate=rate,
            identity=identity,
            packets=self.telemetry,
            board=self.board,
            board_options=options,
        )
