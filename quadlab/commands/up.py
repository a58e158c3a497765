"""`quadlab up`: flies a simulated vehicle under the page; starts, watches and stops all
processes."""

from __future__ import annotations

import contextlib
import secrets
import socket
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.commands.processes import OPEN_BROWSER, SIGN_IN_TOKEN, WATCH_PERIOD, check_tracker
from quadlab.data_folder import data_folder, open_data_folder, owned
from quadlab.option_types import Flag, Folder, Settings, optional
from quadlab.settings import check_laws
from quadlab.simulated.fleet import SimulatedFleet
from quadlab.up.child_words import ChildWords, child_words, set_words
from quadlab.up.landing import land_before_stopping, reserved_descriptors
from quadlab.up.page_options import PageOptions
from quadlab.up.progress import Progress, require_free
from quadlab.up.supervise import Child, stop_all
from quadlab.vehicle_names import THE_VEHICLE, check_name
from quadrotor.checkout import PREFIX
from quadrotor.errors import UsageError
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle_link import clock
from vehicle_link.defects import outlast_readers
from vehicle_link.forked import share
from vehicle_link.lockstep import one_clock
from vehicle_link.serial.capacity import check_rate
from vehicle_link.termination_signal import EndSignal

if TYPE_CHECKING:
    from vehicle_link.security.authority import TlsFiles

MCU_PORTS = ("mcu0", "mcu1")


@dataclass
class Up(PageOptions):
    """Start a simulated vehicle, the station and the page, and print a sign-in link."""

    port: int = 8080
    """HTTP port of the page"""
    data: Folder = None
    """data folder (default: the platform's)"""
    no_browser: Flag = False
    """do not open a browser"""
    link_port: int = 7447
    """port of the radio link (UDP) and of the station's loopback session (TCP)"""
    vehicles: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """simulated vehicles, 1 to 8: quad1, quad2, …; several fly at reduced rates"""
    rate: Annotated[int | None, optional("HZ")] = None
    """ticks per second of each vehicle, 60 to 677, the limit of two serial ports (default: 500;
    with two or three vehicles 100, with more 60)"""
    name: str = THE_VEHICLE
    """namespace of the vehicle's topics"""
    real_time: Flag = False
    """for timing tests: run the simulation in real time, even when flight stack or station are
    late (default: it waits for them, and slows down on a busy computer)"""
    tracker: Annotated[str, optional("WORDS")] = ""
    """fly on the poses of `quadlab tracker` with these arguments, in real time: vrpn, natnet and
    qtm without --host come from the simulator, udp from your own program (default: the station's
    simulated tracker)"""
    firmware: Literal["python", "c"] = "python"
    """firmware of the simulated microcontroller; c (firmware/) is first built with gcc and make"""
    board: str = MIKROKOPTER
    """the simulated vehicles' board: mikrokopter; betaflight, its real
    firmware (scripts/betaflight builds it); crazyflie"""
    set: Settings = ()
    """start with this vehicle parameter, simulator.NAME=VALUE, board.NAME=VALUE,
    which both the vehicle and its simulated board get, or faults=TEXT (docs/how_to/faults.md)"""

    def run(self) -> int:
        check_name(self.name)
        fleet = SimulatedFleet(self.vehicles, self.name, self.link_port)
        fleet.check()
        check_rate(self._rate(fleet), len(MCU_PORTS))
        for port in (self.port, *fleet.ports.values()):
            if not 1 <= port <= 65535:
                raise UsageError(f"port {port} is out of range (1 to 65535)")
        if self.firmware == "c" and self.board != MIKROKOPTER:
            raise UsageError(f"--firmware c is for --board {MIKROKOPTER}, not {self.board}")
        if self.tracker:
            check_tracker(self._tracker_words(fleet))
        settings = child_words(
            self.board,
            self.set,
            data_folder(self.data),
            self.tracker,
            bool(self.tracker and self._serve_words()),
        )
        # After all words: a mistake in them needs neither free ports nor a compiler.
        self._require_free_ports(fleet)
        self._build_firmware()
        folder = open_data_folder(self.data)
        check_laws(settings.values, folder)
        self.check_page(folder)
        if self.host != PageOptions.host:
            require_free("page", self.port, socket.SOCK_STREAM, "--port or --host", self.host)
        with (
            owned(folder),
            tempfile.TemporaryDirectory(
                prefix="quadlab-", ignore_cleanup_errors=True
            ) as run_folder,
            contextlib.nullcontext()
            if self.real_time or self.tracker
            else one_clock(fleet.names, Path(run_folder), self.link_port),
        ):
            progress = Progress(self.host, self.port)
            if self.tracker:
                print("quadlab: in real time, as poses come by quadlab tracker", flush=True)
            groups = self._children(fleet, folder, Path(run_folder), settings)
            from vehicle.processes.parent import IMPORTED

            share([*IMPORTED, f"{PREFIX}vehicle.simulator.process", f"{PREFIX}console.station"])
            return self._watch(groups, fleet, progress)

    def _rate(self, fleet: SimulatedFleet) -> int:
        usual = min(fleet.rates.ticks, find_kind(self.board).rate)
        return usual if self.rate is None else self.rate

    def _ports(self, folder: Path, number: int) -> Sequence[str]:
        """Return the ports of a simulated vehicle, whose number counts from 0."""
        first = find_kind(self.board).udp_port
        if first is not None:
            return [f"udp://127.0.0.1:{first + number}"]
        ports = MCU_PORTS if self.board == MIKROKOPTER else MCU_PORTS[:1]
        return [str(folder / port) for port in ports]

    def _require_free_ports(self, fleet: SimulatedFleet) -> None:
        require_free("page", self.port, socket.SOCK_STREAM, "--port")
        require_free("loopback session", self.link_port, socket.SOCK_STREAM, "--link-port")
        for port in fleet.ports.values():
            require_free("radio link", port, socket.SOCK_DGRAM, "--link-port")
        first = find_kind(self.board).udp_port
        for number in range(fleet.count if first is not None else 0):
            require_free(self.board, (first or 0) + number, socket.SOCK_DGRAM, "--board")

    def _build_firmware(self) -> None:
        """Build the libraries that the simulator needs. Raises QuadlabError when one is missing."""
        if self.firmware == "c":
            from vehicle.simulator.firmware.native import library

            library()
        build = find_kind(self.board).build
        if build is not None:
            build()

    def _children(
        self, fleet: SimulatedFleet, data: Path, run_folder: Path, settings: ChildWords
    ) -> list[list[Child]]:
        """Return the child processes in the order of their start; each list starts and stops
        together.
        """
        from vehicle_link.security.authority import check_certificate, ensure_certificates

        # Made once, here, so that vehicle and station never race to make the authority.
        files = ensure_certificates(data / "certificates", ["127.0.0.1"])
        check_certificate(files, "vehicle", "127.0.0.1")
        check_certificate(files, "station")
        names = [word for name in fleet.names for word in ("--name", name)]
        loopback = ("--loopback-port", str(self.link_port))
        common = ("--data", str(data))
        token = {SIGN_IN_TOKEN: secrets.token_urlsafe(24)}
        if not self.no_browser:
            token[OPEN_BROWSER] = "1"
        dialled = [
            word
            for name, port in fleet.ports.items()
            for word in ("--vehicle", f"{name}=127.0.0.1:{port}")
        ]
        # Flying has priority over display: a busy browser must not delay tracker and link. The page
        # gives way once it serves (web.process); starting with less than the vehicle, which a first
        # start compiles, it would keep everybody waiting.
        first = -10
        # With equal niceness, the one station would get no more time than each of its vehicles.
        station = first if fleet.count == 1 else -19
        simulator = settings.simulator
        if not any(word.startswith("imu_rate=") for word in simulator):
            simulator = ["--set", f"imu_rate={self._rate(fleet)}", *simulator]
        robot = ["simulator", "--folder", str(run_folder), *loopback, *names, *simulator]
        robot += ["--firmware", self.firmware, "--board", self.board]
        base = ["station", *common, *dialled, *loopback, *fleet.station_words]
        of_station = find_kind(self.board).station.items()
        base += set_words([f"{name}={value}" for name, value in of_station]) + settings.station
        if self.tracker:
            base += ["--tracker", self._tracker_words(fleet)]
            robot += self._serve_words()
        page = ["web", *common, "--port", str(self.port), *loopback, *names, *self.words()]
        return [
            [Child("simulator", robot, niceness=first)],
            [
                Child(called, [*words, *settings.vehicle], niceness=first)
                for called, words in self._on_board(fleet, data, run_folder, files).items()
            ],
            [Child("station", base, niceness=station)],
            [Child("web", page, niceness=first, environment=token)],
        ]

    def _tracker_words(self, fleet: SimulatedFleet) -> str:
        """Return the words of `quadlab tracker`; by default each body is named like its vehicle."""
        if "--body" in self.tracker:
            return self.tracker
        return " ".join([self.tracker, *(f"--body {name}={name}" for name in fleet.names)])

    def _serve_words(self) -> list[str]:
        """Return the options with which the simulator acts as the tracking system's server."""
        from vehicle.simulator.tracking_systems.served import known_systems

        system, *words = self.tracker.replace("=", " ").split() or [""]
        if system not in known_systems() or "--host" in words:
            return []
        port = words[words.index("--port") + 1 :][:1] if "--port" in words else []
        return ["--serve", "=".join([system, *port])]

    def _on_board(
        self, fleet: SimulatedFleet, data: Path, run_folder: Path, files: TlsFiles
    ) -> dict[str, list[str]]:
        """Return the command line of each vehicle, by the name of its process."""
        found = {}
        for number, (name, port) in enumerate(fleet.ports.items()):
            folder = run_folder if fleet.count == 1 else run_folder / name
            found["vehicle" if fleet.count == 1 else f"vehicle {name}"] = [
                "vehicle",
                "--board",
                self.board,
                "--serial",
                *self._ports(folder, number),
                "--rate",
                str(self._rate(fleet)),
                "--data",
                str(fleet.folder(data, name, files)),
                "--link-host",
                "127.0.0.1",
                "--link-port",
                str(port),
                "--name",
                name,
                *fleet.vehicle_words,
            ]
        return found

    def _watch(
        self, groups: Sequence[Sequence[Child]], fleet: SimulatedFleet, progress: Progress
    ) -> int:
        children = [child for group in groups for child in group]
        outlast_readers()
        stop = EndSignal()
        reserve = reserved_descriptors()
        try:
            for child in children:
                child.start()
            try:
                while not stop.wait(WATCH_PERIOD):
                    progress.report()
                    for child in children:
                        if event := child.watch():
                            print(f"quadlab: {event}", flush=True)
            finally:  # also where a child, the page for instance, cannot go on
                reserve.close()
                land_before_stopping(self.link_port, fleet.names, stop)
        finally:
            if (words := clock.page()) is not None:
                words[clock.STOPPING] = 1
            for group in reversed(groups):
                stop_all(group)
        print("quadlab: stopped", flush=True)
        return 0
