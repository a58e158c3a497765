"""The four processes as separate commands; `quadlab up` starts all of them."""

from __future__ import annotations

import os
import shlex
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadlab.data_folder import data_folder, open_data_folder
from quadlab.option_types import Flag, Folder, Names, Settings, optional
from quadlab.settings import (
    check_laws,
    offer_plugins,
    parse_board_options,
    parse_settings,
    vehicle_parameters,
)
from quadlab.up import serial_ports
from quadlab.up.page_options import PageOptions, say_authority
from quadlab.up.supervise import Child
from quadlab.vehicle_names import THE_VEHICLE, check_name, parse_names, parse_vehicles
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.extension import LayoutSurvey
from quadrotor.extensions import registry
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle_link.serial.ids import THE_ONE, Identity

WATCH_PERIOD = 0.2
SIGN_IN_TOKEN = "QUADLAB_SIGN_IN_TOKEN"
"""Environment variable through which `up` passes `web` its one-time token."""
OPEN_BROWSER = "QUADLAB_OPEN_BROWSER"
"""Environment variable, set when `web` is to open a browser."""


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


def check_tracker(words: str) -> None:
    """Check the words of `quadlab tracker` for a tracker of poses. Raises UsageError."""
    from quadlab.commands.parsing import parse
    from quadlab.commands.tracker import Tracker

    try:
        command = parse(["tracker", *shlex.split(words)])
    except ValueError as error:
        raise UsageError(f"--tracker {words!r}: {error}; close the quotes") from None
    assert isinstance(command, Tracker)
    command.check()
    if command.of_bearings:
        raise UsageError(
            f"--tracker {words!r}: it provides bearings and no poses; run quadlab tracker "
            f"{command.system} by itself, next to the station"
        )


@dataclass
class Simulator:
    """Run the simulated plant and microcontroller behind two pseudo-terminals."""

    folder: Path
    """folder for the links mcu0 and mcu1 to the pseudo-terminals"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback"""
    name: Names = ()
    """namespace of the vehicle's topics (default: quad1); repeat it for several vehicles"""
    serve: Annotated[tuple[str, ...], optional("SYSTEM[=PORT]")] = ()
    """serve poses like these tracking systems, on loopback: vrpn, natnet, qtm"""
    firmware: Literal["python", "c"] = "python"
    """firmware of the simulated microcontroller; c (firmware/) is first built with gcc and make"""
    board: str = MIKROKOPTER
    """the simulated board: mikrokopter; betaflight, its real firmware (scripts/betaflight builds
    it); crazyflie, behind udp://127.0.0.1:19850 and the ports after it"""
    set: Settings = ()
    """start with this parameter value; tracker.NAME=VALUE changes the noise of the served poses,
    board.NAME=VALUE is an option of the board"""

    def run(self) -> int:
        names = parse_names(self.name)
        from quadrotor.parameters import ParameterStore
        from vehicle.simulator.parameters import SimulatorParameters
        from vehicle.simulator.process import run

        parameters = SimulatorParameters(firmware=self.firmware)
        ParameterStore(parameters).preset(find_kind(self.board).simulated)
        served, prefix = None, "tracker."
        words, options = parse_board_options(self.board, self.set)
        of_tracker = [word for word in words if word.startswith(prefix) and self.serve]
        parse_settings(parameters, [word for word in words if word not in of_tracker])
        if self.serve:
            from bearing_sim import TrackerParameters
            from vehicle.simulator.tracking_systems.served import ServedSystems, parse_systems

            tracker, systems = TrackerParameters(), parse_systems(self.serve)
            parse_settings(tracker, [word.removeprefix(prefix) for word in of_tracker], prefix)
            served = ServedSystems(systems, names, tracker, parameters.served)
        run(
            parameters,
            self.folder,
            self.loopback_port,
            vehicles=names,
            served=served,
            board=self.board,
            board_options=options,
        )
        return 0


@dataclass
class Station:
    """Run the base station: tracker, recorder, run catalogue, forwarding of commands."""

    data: Folder = None
    """data folder"""
    vehicle: Annotated[
        tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="[NAME=]HOST:PORT")
    ] = ()
    """address of a vehicle's radio link (default: 127.0.0.1:7447), or the name of an enrolled one;
    repeat it as NAME=HOST:PORT for several"""
    loopback_port: int = 7447
    """TCP port to listen on, on loopback"""
    name: str = THE_VEHICLE
    """namespace of the vehicle's topics, if --vehicle names none"""
    set: Settings = ()
    """start with this parameter value of the station, like tracker.rate=50"""
    tracker: Annotated[str, optional("WORDS")] = ""
    """also run `quadlab tracker` with these arguments, like "vrpn --host mocap --body cf7", and
    restart it when it dies; turns the simulated tracker off"""

    def run(self) -> int:
        from console.link.known_vehicles import KnownVehicles

        data = open_data_folder(self.data)
        words = KnownVehicles(data).resolved(self.vehicle or ("127.0.0.1:7447",))
        vehicles = parse_vehicles(words, self.name)
        from console.station import run_station

        settings = {}
        if self.set:
            from console.parameters.station import station_parameters

            found = parse_settings(station_parameters(), self.set)
            settings = {f"station.{name}": value for name, value in found.items()}
        if self.tracker:
            self._keep_tracker(data)
        return run_station(
            data,
            vehicles,
            loopback_port=self.loopback_port,
            settings=settings,
            follows_process=bool(self.tracker),
        )

    def _keep_tracker(self, data: Path) -> None:
        """Start the tracker process, and restart it when it dies, in a thread. Raises
        UsageError.
        """
        check_tracker(self.tracker)
        words = ["tracker", "--data", str(data), *shlex.split(self.tracker)]
        words += ["--loopback-port", str(self.loopback_port)]
        child = Child("tracker", words, niceness=-10)

        def keep() -> None:
            try:
                child.start()
                while True:
                    time.sleep(WATCH_PERIOD)
                    if said := child.watch():
                        print(f"station: {said}", flush=True)
            except QuadlabError as error:
                print(f"station: {error}", flush=True)

        threading.Thread(target=keep, name="tracker process", daemon=True).start()


@dataclass
class Web(PageOptions):
    """Serve the page."""

    data: Folder = None
    """data folder"""
    port: int = 8080
    """HTTP port"""
    loopback_port: int = 7447
    """TCP port of the station's session on loopback"""
    name: Names = ()
    """namespace of the vehicle's topics; repeat it for several vehicles (default: those of the
    station's last start with this data folder)"""

    def run(self) -> int:
        from console.link.known_vehicles import station_vehicles

        data = open_data_folder(self.data)
        names = parse_names(self.name or station_vehicles(data))
        tls = self.check_page(data)
        if tls is not None:
            say_authority(tls)
        from web.process import run_web

        surveys = list(registry().offers(LayoutSurvey).values())

        run_web(
            data,
            port=self.port,
            loopback_port=self.loopback_port,
            token=os.environ.get(SIGN_IN_TOKEN),
            vehicles=names,
            open_browser=bool(os.environ.get(OPEN_BROWSER)),
            host=self.host,
            tls=tls,
            survey=surveys[0].load() if surveys else None,
        )
        return 0
