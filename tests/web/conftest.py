"""Whole web process against a scripted station, served by the real server on a free port."""

from __future__ import annotations

import importlib.util
import math
import ssl
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import numpy as np
import pytest
import uvicorn
from starlette.responses import HTMLResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from bearing_sim.emulator import BearingParameters
from console.catalogue.catalogue import Catalogue
from estimation.parameters import EstimationParameters
from quadrotor.errors import LinkError, QuadlabError, UnreachableError
from quadrotor.parameters import Parameters, ParameterStore, parameter
from quadrotor.records import TICK, Record
from tests.support.runs import run_entry
from tests.support.survey import survey
from tests.waiting import wait_for
from vehicle_link.messages import encode, header, new
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.telemetry import pack
from vehicle_link.transport.publisher import Received
from web.access.passwords import Passwords
from web.access.sign_in_limiter import SignInLimiter
from web.access.tls import Tls
from web.assembly import assemble
from web.latest import TICKS
from web.live.sockets import listen
from web.live.station import Station
from web.process import server, url_of
from web.view.server import ViewServer

RUN = "20260131T093042Z_quad1"
LOG = bytes(range(256)) * 40


class _Gains(Parameters):
    kp: float = parameter(4.0, unit="1/s²", ge=0, le=20, step=0.1, description="position gain")
    laps: int = parameter(3, ge=1, le=10, description="number of laps")
    exact: bool = parameter(False, description="exact rates")
    rate: str = parameter("nominal", choices=("nominal", "exact"), description="which rates")
    fixed: float = parameter(1.0, ge=0, le=2, read_only=True, description="set at the start")


class _Root(Parameters):
    gains: _Gains = _Gains()


class Compared(Parameters):
    estimators: str = parameter("", description="estimators compared at the station")


class _OnBearings(Parameters):
    bearings: BearingParameters = BearingParameters()
    comparison: Compared = Compared()


class _BearingsRoot(Parameters):
    estimation: EstimationParameters = EstimationParameters()
    station: _OnBearings = _OnBearings()


class ScriptedStation(Station):
    """Station that answers as one with a vehicle would, without a network."""

    def start(self) -> None:
        self.instance = 1  # of the vehicle's process
        self.store = ParameterStore(_Root().model_copy(deep=True))
        self.requests: list[tuple[str, Any]] = []
        self.sticks: list[tuple[tuple[float, ...], bool]] = []
        self.specific_force = (0.0, 0.0, 0.0)
        self.answers_sticks = True
        self.present: set[str] = set()
        self.published: list[tuple[str, bytes, int | None]] = []
        self.real_time_factor = 0.0
        self.said: dict[str, Any] = {}  # fields of the status that differ from the default
        self.refusal = ""
        self.answers: dict[str, dict[str, Any]] = {}  # fields of a service's answer
        self.away = False
        self.silence: LinkError = UnreachableError("the base station cannot be reached")
        self.compared = False
        self.residuals: dict[int, float] | None = None
        self.told: dict[str, Any] | None = None  # fields of its experiment's status
        self.answering = threading.Event()
        self.answering.set()

    def stop(self) -> None:
        self.answering.set()
        super_callers = (self._callers, self._urgent)
        for executor in super_callers:
            executor.shutdown(wait=False, cancel_futures=True)

    def publish_stick(
        self, axes: tuple[float, float, float, float], enabled: bool, requester: str
    ) -> int:
        """Answer at once, as a station without other sticks does."""
        self.sticks.append((axes, enabled))
        stamp_ns = time.time_ns()
        if self.answers_sticks:
            self.reactions.stick_answered(stamp_ns, enabled, "")
        return stamp_ns

    def publish(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        self.published.append((topic, payload, stamp_ns))

    def publish_presence(self, labels: Any) -> None:
        self.present = set(labels)

    def control(self, holder: str, asking: str = "", answer_within: float = 0.0) -> None:
        """Publish who commands, as the station does."""
        self.put(
            "control",
            new(
                "quadlab_msgs/ControlStatus",
                header=header(time.time_ns()),
                holder=holder,
                asking=asking,
                answer_within=answer_within,
            ),
        )

    def put(self, topic: str, message: Any) -> None:
        payload = pack(message, 0) if isinstance(message, np.ndarray) else encode(message)
        self._live.put(topic, payload, time.time_ns())

    @property
    def watched(self) -> set[str]:
        """Return the topics that are received because a page shows them."""
        return set(self._watched.wanted)

    @property
    def forwarded(self) -> set[str]:
        """Return the topics that are forwarded as they arrive."""
        return set(self._forwarded.wanted)

    def deliver(self, topic: str, message: Any, received_ns: int = 1) -> None:
        """Deliver a message of such a topic, as Zenoh's thread does."""
        self._forwarded.wanted[topic](Received(encode(message), 1, received_ns, received_ns))

    def tick(self, x: float = 1.0, y: float = 2.0, z: float = 1.5) -> Record:
        """Return a tick of the present time."""
        tick = np.zeros(1, TICK)
        state, actuators = tick["state"], tick["actuators"]
        tick["imu"]["stamp_ns"] = time.time_ns()
        tick["imu"]["specific_force_b"] = self.specific_force
        state["position_w"], state["quaternion_wb"] = (x, y, z), (0.8, 0.0, 0.0, 0.6)
        state["velocity_w"], state["angular_velocity_b"] = (0.28, 0.96, 0.5), (0.1, 0.2, 0.3)
        tick["reference"]["position_w"] = (x, y, 1.0)
        actuators["wrench"][:, 0], actuators["motor_references"] = 12.8, 127.0
        return tick

    def fly(self, x: float = 1.0, y: float = 2.0, z: float = 1.5) -> None:
        """Publish one sample of everything, with the present time."""
        stamp = header(time.time_ns())
        pose = {"pose": {"position": (x, y, z), "orientation": (0.0, 0.0, 0.6, 0.8)}}
        twist = {"twist": {"linear": (1.0, 0.0, 0.5), "angular": (0.1, 0.2, 0.3)}}
        self.put("truth", new("nav_msgs/Odometry", header=stamp, pose=pose, twist=twist))
        self.put(TICKS, self.tick(x, y, z))
        self.put("estimator", new("quadlab_msgs/EstimatorStatus", header=stamp, mass=1.31))
        self.put(
            "status",
            new(
                "quadlab_msgs/VehicleStatus",
                header=stamp,
                **{
                    "mode": "armed",
                    "behavior": "hover",
                    "control_mode": "direct",
                    "armed": True,
                    "airborne": True,
                    "flags": ["not_real_time"],
                    "lateness_p50": 4.2e-5,
                    "lateness_p99": 1.4e-4,
                    "lateness_max": 6e-3,
                    "tick_rate": 499.8,
                    "nominal_rate": 500.0,
                    "lateness_histogram": (91234, 8123, 712, 60, 5, 0, 0, 1),
                    "overruns": 2,
                    "missed_frames": 5,
                    "parameter_revision": self.store.revision,
                    "instance": self.instance,
                    **self.said,
                },
            ),
        )
        self.put("battery", new("sensor_msgs/BatteryState", header=stamp, voltage=15.6))
        self.put(
            "link_status",
            new("quadlab_msgs/LinkStatus", header=stamp, state="good", age=0.011, loss=0.02),
        )
        self.put(
            "station_status",
            new(
                "quadlab_msgs/StationStatus",
                header=stamp,
                tracker_rate=100.0,
                recording=True,
                recording_duration=12.0,
                recording_bytes=84_000_000,
                real_time_factor=self.real_time_factor,
            ),
        )

    def compare(
        self, names: tuple[str, ...] = ("vehicle", "error_state"), residuals: Any = None
    ) -> None:
        """Publish one comparison: estimator i is (10 + i) mm off; residuals are in rad."""
        seen = {1: 0.010, 2: 0.020, 3: 0.030, 4: 0.120} if residuals is None else residuals
        results = [
            new(
                "quadlab_msgs/EstimatorResult",
                name=name,
                initialized=True,
                converged=True,
                position_error=0.010 + 0.001 * i,
                attitude_error=0.005,
                position_rms_recent=0.020 + 0.001 * i,
                position_max_recent=0.050,
                position_rms=0.030 + 0.001 * i,
                position_max=0.2,
                attitude_rms_recent=0.01,
                attitude_rms=0.02,
                attitude_max=0.03,
                attitude_max_recent=0.02,
                processor=math.nan if name == "vehicle" else 0.0123,
                position_covariance=[4e-4, 0, 0, 0, 4e-4, 0, 0, 0, 1e-4],
                attitude_variance=1e-4,
                beacon_ids=list(seen),
                residuals=list(seen.values()),
            )
            for i, name in enumerate(names)
        ]
        self.put(
            "comparison",
            new(
                "quadlab_msgs/EstimatorComparison",
                header=header(time.time_ns()),
                truth="truth",
                duration=133.0,
                sigma=math.radians(1.5),
                position_bound=0.027,
                attitude_bound=0.02,
                estimators=results,
            ),
        )

    def _read_parameters(self, remote: str) -> Any:
        if remote != f"/{self._vehicle}/vehicle":
            raise LinkError("no such node")
        return list(self.store.descriptions()), self.store.values()

    def _call_blocking(self, service: str, request: Any) -> Any:
        self.requests.append((service, request))
        self.answering.wait(20.0)
        if self.away:
            raise self.silence
        kind = request.__msgtype__.replace("/srv/msg/", "/srv/").replace("_Request", "_Response")
        if self.refusal:
            return new(kind, accepted=False, reason=self.refusal)
        if service != "change_parameters":
            return new(kind, accepted=True, **self.answers.get(service, {}))
        try:
            applied = self.store.set(from_parameters(request.parameters))
        except QuadlabError as error:
            return new(kind, accepted=False, reason=str(error))
        return new(
            kind, accepted=True, applied=to_parameters(applied), revision=self.store.revision
        )


@dataclass
class Site:
    """Running web process: its address, its sign-in, and its station."""

    base: str
    data: Path
    station: ScriptedStation
    view_server: ViewServer
    gate: Any
    links: list[str] = field(default_factory=list)
    clock: list[float] = field(default_factory=list)
    tls: Tls | None = None
    vehicle: Any = None
    stations: list[ScriptedStation] = field(default_factory=list)
    """Stations of all vehicles."""

    @property
    def verify(self) -> Any:
        """Return the trust of a browser that has this data folder's authority."""
        if self.tls is None:
            return False
        context = ssl.create_default_context(cafile=self.tls.authority)
        context.verify_flags |= ssl.VERIFY_X509_STRICT  # as Python 3.13 does
        return context

    @property
    def host(self) -> str:
        return urlsplit(self.base).netloc

    @property
    def token(self) -> str:
        return parse_qs(urlsplit(self.links[-1]).query)["token"][0]

    def browser(self) -> httpx.Client:
        """Return a client that is not signed in."""
        return httpx.Client(base_url=self.base, timeout=20.0, verify=self.verify)

    def sign_in(self, token: str | None = None) -> httpx.Client:
        """Return a signed-in client."""
        with self.browser() as first:
            answer = first.post("/login", data={"token": token or self.token})
        assert answer.status_code == 200, answer.text
        client = self.browser()
        client.cookies.update(answer.cookies)
        return client

    def invited(self, by: httpx.Client, role: str) -> httpx.Client:
        """Return a client that signed in by an invitation."""
        url = by.post("/api/invitations", json={"role": role}).json()["url"]
        return self.sign_in(parse_qs(urlsplit(url).query)["token"][0])

    def cookies_of(self, client: httpx.Client) -> list[dict[str, str]]:
        """Return the cookies in Playwright's form."""
        return [{"name": n, "value": v, "url": self.base} for n, v in client.cookies.items()]

    def cookie(self, client: httpx.Client) -> str:
        return "; ".join(f"{name}={value}" for name, value in client.cookies.items())

    def websocket(
        self,
        path: str,
        cookie: str | None,
        origin: str | None = None,
        subprotocol: str | None = None,
    ) -> Any:
        """Return an open websocket (websockets.sync), to be used with `with`."""
        import websockets.sync.client

        headers = {"Cookie": cookie} if cookie else {}
        return websockets.sync.client.connect(
            f"ws://{self.host}{path}",
            additional_headers=headers,
            origin=websockets.Origin(origin or self.base),
            subprotocols=[websockets.Subprotocol(subprotocol)] if subprotocol else None,
            compression=None,
            proxy=None,
            open_timeout=60.0,
        )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    data = tmp_path_factory.mktemp("data")
    catalogue = Catalogue(data)
    (data / "runs" / f"{RUN}.mcap").write_bytes(LOG)
    began_ns = 1_769_851_842_000_000_000
    fields = {"duration": 63.2, "bytes": len(LOG), "messages": 7, "operator": "operator 1"}
    catalogue.add(run_entry(RUN, start_ns=began_ns, **fields))
    catalogue.add(run_entry("elsewhere", start_ns=1, file="../web/door.json", bytes=1, operator=""))
    with serving(data, catalogue) as running:
        yield running


@pytest.fixture(scope="module")
def beacon_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Yield a site whose station has the parameters of bearings, and compares estimators."""
    data = tmp_path_factory.mktemp("beacons")
    with serving(data, Catalogue(data)) as running:
        station, fly = running.station, running.station.fly
        station.store = ParameterStore(_BearingsRoot().model_copy(deep=True))
        station.compared = True

        def fly_and_compare(x: float = 1.0, y: float = 2.0, z: float = 1.5) -> None:
            fly(x, y, z)
            if station.compared:
                names = str(station.store.values()["station.comparison.estimators"]).split()
                station.compare(("vehicle", *names), station.residuals)

        station.fly = fly_and_compare  # type: ignore[method-assign]
        yield running


@pytest.fixture(scope="session")
def helper() -> Callable[[str], Any]:
    """Return a function that imports a module of this folder which is no test.

    An example is `helper("calibrating")`.
    """

    def load(path: str) -> Any:
        name = path.rpartition("/")[2]
        if name in sys.modules:
            return sys.modules[name]
        spec = importlib.util.spec_from_file_location(name, Path(__file__).parent / f"{path}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # where pydantic looks names up
        spec.loader.exec_module(module)
        return module

    return load


class serving:  # noqa: N801 - used as `with serving(...)`
    """The whole process in a thread; `stop` and start again keep the data folder."""

    view: str | None = None
    """Document served in place of viser's; None for viser.

    The browser could replace it itself, but would then ask its driver about each of a page's
    hundred files.
    """
    usual_port: int = 0
    """Port that is taken while it is free; 0 for any."""

    def __init__(
        self,
        data: Path,
        catalogue: Catalogue,
        token: str | None = None,
        port: int = 0,
        tls: Tls | None = None,
        kind: Callable[..., Station] = ScriptedStation,
        open_session: Callable[[], Any] = lambda: None,
        vehicles: tuple[str, ...] = ("quad1",),
    ) -> None:
        try:
            self._listener = listen("127.0.0.1", port or serving.usual_port)
        except LinkError:
            self._listener = listen("127.0.0.1", port)
        base = url_of("127.0.0.1", self._listener.getsockname()[1], has_tls=tls is not None)
        made: list[Any] = []
        links: list[str] = []

        def connect(vehicle: str, *more: Any) -> Station:
            station: Station = kind(open_session, vehicle, *more)
            made.append(station)
            return station

        def show(url: str, signed_in: str | None = None) -> None:
            links.append(url)

        view_servers: list[ViewServer] = []

        def new_view_server() -> ViewServer:
            view_servers.append(ViewServer())
            return view_servers[-1]

        now = [0.0]  # s, of the sign-in limits; a test moves it
        with pytest.MonkeyPatch.context() as patch:  # a real survey takes minutes
            patch.setattr("web.beacons.survey.offered", lambda: survey)
            app = assemble(
                limiter=SignInLimiter(lambda: now[0]),
                passwords=Passwords(1, 8),
                data=data,
                base_url=base,
                vehicles=vehicles,
                token=token,
                connect=connect,
                catalogue=catalogue,
                show_link=show,
                new_view_server=new_view_server,
            )
        self._server: uvicorn.Server = server(_with_view(app), self._listener, tls)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._listener]}, daemon=True
        )
        self.site = Site(base, data, made[0], view_servers[0], app, links, now, tls)
        self.site.stations = made

    def __enter__(self) -> Site:
        self._thread.start()
        wait_for(lambda: bool(self.site.links) and self._server.started)
        return self.site

    def __exit__(self, *_: object) -> None:
        self._server.should_exit = True
        self._thread.join(timeout=15.0)
        self._listener.close()
        assert not self._thread.is_alive()


def _with_view(app: ASGIApp) -> ASGIApp:
    async def serve(scope: Scope, receive: Receive, send: Send) -> None:
        blank = serving.view is not None and scope["type"] == "http"
        answer = HTMLResponse(serving.view) if blank and _is_view(scope) else app
        await answer(scope, receive, send)

    return serve


def _is_view(scope: Scope) -> bool:
    return str(scope["path"]).endswith("/viser/")


@pytest.fixture
def until() -> Callable[..., None]:
    return wait_for


@pytest.fixture(scope="session")
def serve() -> type[serving]:
    return serving


@pytest.fixture
def station(site: Site) -> Iterator[ScriptedStation]:
    """Yield the site's station with a clean script."""
    site.station.requests.clear()
    yield site.station
    site.station.refusal = ""
    site.station.said = {}
    site.station.away = False
    site.station.silence = UnreachableError("the base station cannot be reached")
    site.station.answering.set()


@pytest.fixture
def admin(site: Site) -> Iterator[httpx.Client]:
    """Yield an administrator's client, signed in by the terminal's link."""
    with site.sign_in() as client:
        yield client


@pytest.fixture
def operator(site: Site, admin: httpx.Client) -> Iterator[httpx.Client]:
    with site.invited(admin, "operator") as client:
        yield client


@pytest.fixture
def viewer(site: Site, operator: httpx.Client) -> Iterator[httpx.Client]:
    with site.invited(operator, "viewer") as client:
        yield client


@pytest.fixture
def flying(station: ScriptedStation) -> Iterator[Callable[[bool], None]]:
    """Yield a function that silences (False) or resumes a vehicle that publishes at 10 Hz."""
    going, talking, publishing = threading.Event(), threading.Event(), threading.Lock()
    going.set()
    talking.set()

    def fly() -> None:
        while going.is_set():
            with publishing:
                if talking.is_set():
                    station.fly()
            threading.Event().wait(0.1)

    def talk(on: bool) -> None:
        with publishing:  # once this returns, no publication is under way
            (talking.set if on else talking.clear)()

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    yield talk
    going.clear()
    thread.join()
