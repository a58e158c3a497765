"""Three of the four processes as separate commands; `quadlab up` starts all of them."""

from __future__ import annotations

import os
import shlex
import threading
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Folder, Names, Settings, optional
from quadlab.settings import parse_board_options, parse_settings
from quadlab.up.page_options import PageOptions, say_authority
from quadlab.up.supervise import Child
from quadlab.vehicle_names import THE_VEHICLE, parse_names, parse_vehicles
from quadrotor.errors import QuadlabError, UsageError
from vehicle.boards.kind import MIKROKOPTER, find_kind

WATCH_PERIOD = 0.2
SIGN_IN_TOKEN = "QUADLAB_SIGN_IN_TOKEN"
"""Environment variable through which `up` passes `web` its one-time token."""
OPEN_BROWSER = "QUADLAB_OPEN_BROWSER"
"""Environment variable, set when `web` is to open a browser."""


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
        from vehicle.simulator.boards import firmware_of
        from vehicle.simulator.parameters import SimulatorParameters
        from vehicle.simulator.process import run

        parameters = SimulatorParameters(firmware=self.firmware)
        kind = find_kind(self.board)
        ParameterStore(parameters).preset(kind.simulated)
        served, prefix = None, "tracker."
        words, options = parse_board_options(self.board, self.set)
        of_tracker = [word for word in words if word.startswith(prefix) and self.serve]
        parse_settings(parameters, [word for word in words if word not in of_tracker])
        if self.serve:
            from bearing_sim.tracker import TrackerParameters
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
            firmware=partial(firmware_of, self.board, kind.configured(options)),
            is_asked=kind.is_asked,
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

        run_web(
            data,
            port=self.port,
            loopback_port=self.loopback_port,
            token=os.environ.get(SIGN_IN_TOKEN),
            vehicles=names,
            open_browser=bool(os.environ.get(OPEN_BROWSER)),
            host=self.host,
            tls=tls,
        )
        return 0
