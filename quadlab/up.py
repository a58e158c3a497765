"""`quadlab up`: a simulated vehicle flying under the page; starts, watches and stops all."""

from __future__ import annotations

import secrets
import signal
import socket
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from quadlab.data_folder import open_data_folder, owned
from quadlab.landing import land_before_stopping
from quadlab.page_options import PageOptions
from quadlab.processes import OPEN_BROWSER, SIGN_IN_TOKEN, Folder, Rate, Settings, check_name
from quadlab.settings import parse_settings
from quadlab.supervise import Child
from quadrotor.errors import UsageError
from vehicle_link.serial.capacity import DEFAULT_RATE, check_rate

WATCH_PERIOD = 0.2
MCU_PORTS = ("mcu0", "mcu1")


@dataclass
class Up(PageOptions):
    """Fly a simulated vehicle under the page: the main job."""

    port: int = 8080
    """HTTP port of the page"""
    data: Folder = None
    """data folder (default: the platform's)"""
    no_browser: bool = False
    """do not open a browser"""
    link_port: int = 7447
    """port of the radio link (UDP) and of the station's loopback session (TCP)"""
    rate: Rate = DEFAULT_RATE
    """ticks of the vehicle a second, 60 to 677: what two serial ports carry"""
    name: str = "quad1"
    """namespace of the vehicle's topics"""
    set: Settings = ()
    """start with this vehicle parameter, or simulator.NAME=VALUE"""

    def run(self) -> int:
        check_name(self.name)
        check_rate(self.rate, len(MCU_PORTS))
        self._check_ports()
        vehicle_words, simulator_words = self._check_settings()
        folder = open_data_folder(self.data)
        self.check_page(folder)
        if self.host != PageOptions.host:
            _require_free("page", self.port, socket.SOCK_STREAM, "--port or --host", self.host)
        with owned(folder), tempfile.TemporaryDirectory(prefix="quadlab-") as run_folder:
            children = self._children(folder, Path(run_folder), vehicle_words, simulator_words)
            return self._watch(children)

    def _check_ports(self) -> None:
        for port in (self.port, self.link_port):
            if not 1 <= port <= 65535:
                raise UsageError(f"port {port} is not one; allowed 1 to 65535")
        _require_free("page", self.port, socket.SOCK_STREAM, "--port")
        _require_free("loopback session", self.link_port, socket.SOCK_STREAM, "--link-port")
        _require_free("radio link", self.link_port, socket.SOCK_DGRAM, "--link-port")

    def _check_settings(self) -> tuple[list[str], list[str]]:
        if not self.set:
            return [], []
        # Imported for their names and bounds alone: 100 MB that a plain start need not carry.
        from vehicle.parameters import new_parameters
        from vehicle.simulator.parameters import SimulatorParameters

        prefix = "simulator."
        vehicle = [word for word in self.set if not word.startswith(prefix)]
        simulator = [word.removeprefix(prefix) for word in self.set if word.startswith(prefix)]
        parse_settings(new_parameters(), vehicle)
        parse_settings(SimulatorParameters(), simulator, prefix)
        return _set_words(vehicle), _set_words(simulator)

    def _children(
        self, data: Path, run_folder: Path, vehicle: list[str], simulator: list[str]
    ) -> list[Child]:
        from vehicle_link.authority import check_certificate, ensure_certificates

        # Made here, once, so that vehicle and station never race to make the authority.
        files = ensure_certificates(data / "certificates", ["127.0.0.1"])
        check_certificate(files, "vehicle", "127.0.0.1")
        check_certificate(files, "station")
        loopback = ("--loopback-port", str(self.link_port), "--name", self.name)
        common = ("--data", str(data))
        token = {SIGN_IN_TOKEN: secrets.token_urlsafe(24)}
        if not self.no_browser:
            token[OPEN_BROWSER] = "1"
        ports = [str(run_folder / port) for port in MCU_PORTS]
        rate = ("--rate", str(self.rate))
        link = ("--link-port", str(self.link_port), "--name", self.name)
        address = f"127.0.0.1:{self.link_port}"
        # What flies goes before what shows: a busy browser must not delay tracker and link.
        first, last = {"niceness": -10}, {"niceness": 5}
        robot = ["simulator", "--folder", str(run_folder), *loopback, *simulator]
        on_board = ["vehicle", "--serial", *ports, *rate, *common, *link, *vehicle]
        base = ["station", *common, "--vehicle", address, *loopback]
        page = ["web", *common, "--port", str(self.port), *loopback, *self.words()]
        return [
            Child("simulator", robot, **first),
            Child("vehicle", on_board, **first),
            Child("station", base, **first),
            Child("web", page, **last, environment=token),
        ]

    def _watch(self, children: Sequence[Child]) -> int:
        stop = _StopRequest()
        with stop.installed():
            try:
                for child in children:
                    child.start()
                while not stop.wait(WATCH_PERIOD):
                    for child in children:
                        said = child.watch()
                        if said:
                            print(f"quadlab: {said}", flush=True)
                land_before_stopping(self.link_port, self.name, stop)
            finally:
                for child in reversed(children):
                    child.stop()
        return 0


class _StopRequest:
    """Ctrl-C or SIGTERM: the first asks to stop, a second one to stop at once."""

    def __init__(self) -> None:
        self.count = 0

    def installed(self) -> _Handlers:
        return _Handlers(self)

    def wait(self, seconds: float) -> bool:
        """Sleep at most `seconds`; whether a stop was asked for."""
        end = time.monotonic() + seconds
        while not self.count and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.1))
        return bool(self.count)

    @property
    def at_once(self) -> bool:
        return self.count > 1


class _Handlers:
    def __init__(self, request: _StopRequest) -> None:
        self._request = request
        self._previous: dict[int, object] = {}

    def __enter__(self) -> _StopRequest:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._previous[number] = signal.signal(number, self._on_signal)
        return self._request

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._request.count += 1


def _set_words(settings: Sequence[str]) -> list[str]:
    return [word for setting in settings for word in ("--set", setting)]


def _require_free(
    what: str, port: int, kind: socket.SocketKind, option: str, host: str = "127.0.0.1"
) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UsageError(
                f"port {port} of the {what} cannot be used ({error.strerror}); "
                f"stop what uses it or choose another with {option}"
            ) from None
