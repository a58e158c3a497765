"""A running laboratory for scripts and notebooks, through its page's HTTP interface.

with quadlab.connect("http://127.0.0.1:8080/?token=…") as lab:
    lab.parameters["control.position.kp_xy"]
    run = lab.fly("figure_eight", yaw_amplitude=0.5)   # the station flies, judges and records it
    run.result.verdict, run["state"].pandas()
"""

from __future__ import annotations

import json
import math
import ssl
import struct
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlsplit

import httpx
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import connect as open_socket
from websockets.sync.connection import Connection

from quadlab.calibration.dialogue import RUNNING
from quadrotor.errors import LinkError, RefusedError, UnreachableError, UsageError
from quadrotor.parameter_description import ParameterValue

if TYPE_CHECKING:
    from quadlab.run import Run

HEAD, SERIES = struct.Struct("<HHHHdd"), struct.Struct("<IIII")
"""The beginning of a frame, and of a series in it, as in `web.live.frames`."""
REACH = 10.0
"""Seconds to wait for an answer of the page's server."""
RETRY = 0.5
"""Seconds between two attempts to connect again, and between two queries of an experiment."""
STARTED = 10.0
"""Seconds within which an accepted experiment has begun, or has ended."""


def connect(
    url: str, name: str = "", password: str = "", *, authority: Path | None = None
) -> Laboratory:
    """Sign in at a running laboratory.

    Args:
        url: the sign-in link that `quadlab up` prints or a page makes (each works once), or the
            page's address, with the name and password of an account.
        authority: the certificate (PEM) of the laboratory's own authority, for `--tls`.

    Raises UnreachableError when no server answers, RefusedError when the link was used already or
    the password is wrong.
    """
    return Laboratory(url, name, password, authority)


class Laboratory:
    """The vehicle, station and runs behind one page; made by `connect`.

    Commands are the same as for a person at the page: the first one takes control if it is free,
    and keeps it while this is open. Raises LinkError while something cannot be reached,
    RefusedError with the reason when a command is refused.

    Attributes:
        label: name of this user as the page shows it. role: viewer, operator or admin.
    """

    def __init__(self, url: str, name: str, password: str, authority: Path | None) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.netloc:
            raise UsageError(f"{url!r} is not an address; give http://HOST:PORT, or a sign-in link")
        self._base = f"{parts.scheme}://{parts.netloc}"
        is_tls = parts.scheme == "https"
        try:
            self._tls = ssl.create_default_context(cafile=authority) if is_tls else None
        except OSError as error:  # ssl.SSLError is one
            raise UsageError(
                f"{authority} cannot be read as a certificate (PEM): {error}"
            ) from None
        self._client = httpx.Client(
            base_url=self._base,
            headers={"origin": self._base},
            timeout=REACH,
            verify=self._tls or True,
            follow_redirects=True,
            trust_env=False,  # no proxy
        )
        try:
            if name:
                self._ask("POST", "/login", data={"name": name, "password": password})
            elif parts.query:
                self._ask("POST", "/login", data=dict(parse_qsl(parts.query)))
            session = self._json("GET", "/api/session")
        except RefusedError as error:
            self._client.close()
            raise RefusedError(
                f"not signed in at {self._base} ({error}): a sign-in link is good once, an open "
                "page makes another; or give the name and password of an account"
            ) from None
        except LinkError:
            self._client.close()
            raise
        self.label, self.role = str(session["label"]), str(session["role"])
        self._closing = threading.Event()
        self._presence: Connection | None = None
        self._thread = threading.Thread(target=self._hold_presence, name="laboratory", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Sign off; running behaviours and experiments continue, and control becomes free after
        some seconds.
        """
        self._closing.set()
        if self._presence is not None:
            self._presence.close()
        self._thread.join(REACH)
        self._client.close()

    def __enter__(self) -> Laboratory:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    # ------------------------------------------------------------------ queries
    @property
    def summary(self) -> dict[str, Any]:
        """Return the newest states: vehicle `status`, `link`, `battery`, `experiment`, ages."""
        found: dict[str, Any] = self._json("GET", "/api/summary")
        return found

    @property
    def parameters(self) -> dict[str, ParameterValue]:
        """Return the confirmed values of vehicle, station and simulator."""
        listed = self._json("GET", "/api/parameters")["parameters"]
        return {one["name"]: one["value"] for one in listed}

    @property
    def signals(self) -> list[str]:
        """Return the names that `stream` accepts."""
        return [one["name"] for one in self._json("GET", "/api/signals")["signals"]]

    def stream(self, *signals: str, rate: float | None = None) -> Iterator[dict[str, float]]:
        """Yield every sample from now on: `time` (s, the vehicle's stamp) and each signal in its
        unit, at the samples of the first signal, as charts and logs have them.

        Signals of other topics are interpolated between their samples, NaN where there are none.

        Args:
            rate: Hz; yield the mean of all samples in each 1/rate s instead, of time and of each
                signal. An angle that wraps has no mean.

        Raises UsageError for an unknown signal or a rate that is not positive, LinkError when the
        connection ends, or when this program does not keep up.
        """
        if rate is not None and not 0.0 < rate < math.inf:
            raise UsageError(f"rate={rate} of a stream: allowed are positive numbers, in Hz")
        samples = self._samples(signals)
        return samples if rate is None else thinned(samples, rate)

    def _samples(self, signals: Sequence[str]) -> Iterator[dict[str, float]]:
        with self._socket("/ws/telemetry") as socket:
            wanted: dict[str, Any] = {"id": 1, "signals": []}
            socket.send(json.dumps(wanted))
            try:
                for frame in socket:
                    if not isinstance(frame, bytes):
                        continue
                    number, _, _, _, origin, now = HEAD.unpack_from(frame)
                    if number == 1:  # what the vehicle's time is: the samples begin here
                        series = [{"signals": list(signals), "after": now}]
                        wanted = {
                            "id": 2,
                            "signals": [],
                            "origin": origin,
                            "series": series,
                            "ages": False,
                        }
                        socket.send(json.dumps(wanted))
                    else:
                        yield from _decoded(frame, signals)
            except ConnectionClosed as error:
                if error.rcvd is not None and error.rcvd.code == 1008:
                    raise UsageError(f"telemetry: {error.rcvd.reason}") from None
                raise LinkError(f"telemetry of {self._base} ended: {error}") from None

    # ------------------------------------------------------------------ commands
    def set(self, values: Mapping[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Change parameters, all or none; return the values in force."""
        answer = self._json("PUT", "/api/parameters", json={"values": dict(values)})
        applied: dict[str, ParameterValue] = answer["applied"]
        return applied

    def command(self, command: str, **fields: Any) -> None:
        """Give a command as on the page: arm, disarm, start_behavior, emergency …"""
        self._json("POST", f"/api/commands/{command}", json=fields)

    def start(self, behavior: str, **arguments: float | str | bool) -> None:
        """Start a behavior: take_off (height), hover, go_to (x, y, z, yaw), land …"""
        self.command("start_behavior", name=behavior, arguments=arguments)

    def fly(self, experiment: str, **options: ParameterValue) -> Run:
        """Let the station fly an experiment; return its run with the verdict when it has ended.

        Raises RefusedError when it is refused, LinkError when it is stopped before its end.
        """
        from console.experiments.client import Result

        before = self._experiment().get("run_id", "")
        body = {"name": experiment, "options": options}
        self._json("POST", "/api/experiments/start", json=body)
        limit = time.monotonic() + STARTED
        has_begun = False
        while True:
            summary = self.summary
            now, age = summary.get("experiment") or {}, summary["age"].get("experiment_status")
            if has_begun and (age is None or age > REACH):
                raise LinkError(f"the station is silent; {experiment} may still be flying")
            is_ours = (now.get("name"), now.get("requester")) == (experiment, self.label)
            is_running = is_ours and now["phase"] in RUNNING
            has_begun = has_begun or is_running
            if not is_running and (has_begun or (is_ours and now["run_id"] not in ("", before))):
                break  # an earlier experiment has another run
            if not has_begun and time.monotonic() > limit:
                break
            time.sleep(RETRY)
        if not is_ours or not now["verdict"] or now["run_id"] in ("", before):
            found = f"{now.get('phase', 'unknown')}; {now.get('reason', '')}"
            raise LinkError(f"{experiment} has no verdict; the station's experiment is: {found}")
        metrics = {one["name"]: one["value"] for one in now["metrics"]}
        limits = {one["name"]: one["limit"] for one in now["metrics"] if one["limit"] is not None}
        result = Result(now["verdict"], metrics, limits, now["reason"])
        return self.open(now["run_id"], result=result)

    # ------------------------------------------------------------------ runs
    @property
    def runs(self) -> list[dict[str, Any]]:
        """Return the recorded runs, newest first: id, start, duration, operator, tags …"""
        found: list[dict[str, Any]] = self._json("GET", "/api/runs")
        return found

    def open(self, run: str, folder: Path | None = None, result: Any = None) -> Run:
        """Download a run and return it; without `folder`, into a temporary folder."""
        from quadlab.run import Run

        place = Path(tempfile.mkdtemp(prefix="quadlab-")) if folder is None else folder
        file = place / f"{run}.mcap"
        part = file.with_suffix(".part")
        try:
            with self._client.stream("GET", f"/api/runs/{run}/download") as answer:
                if answer.status_code != httpx.codes.OK:
                    answer.read()
                    raise RefusedError(_reason(answer))
                with part.open("wb") as out:
                    for piece in answer.iter_bytes():
                        out.write(piece)
        except httpx.TransportError as error:
            part.unlink(missing_ok=True)
            raise UnreachableError(f"{self._base} was lost in a download: {error}") from None
        part.replace(file)
        return Run(file, result)

    # ------------------------------------------------------------------ requests
    def _experiment(self) -> dict[str, Any]:
        return self.summary.get("experiment") or {}

    def _json(self, method: str, path: str, **more: Any) -> Any:
        return self._ask(method, path, **more).json()

    def _ask(self, method: str, path: str, **more: Any) -> httpx.Response:
        try:
            answer = self._client.request(method, path, **more)
        except httpx.TransportError as error:
            raise UnreachableError(
                f"no page answers at {self._base} ({error}); start `quadlab up`, or correct the "
                "address"
            ) from None
        if answer.is_error:
            kind = LinkError if answer.status_code in (502, 503, 504) else RefusedError
            raise kind(_reason(answer))
        return answer

    def _socket(self, path: str) -> Connection:
        cookies = "; ".join(f"{one.name}={one.value}" for one in self._client.cookies.jar)
        address = f"{self._base.replace('http', 'ws', 1)}{path}"
        try:
            return open_socket(
                address,
                additional_headers={"Cookie": cookies},
                origin=self._base,  # type: ignore[arg-type]  # a NewType of str
                open_timeout=REACH,
                max_size=None,
                ssl=self._tls,
                proxy=None,
            )
        except (OSError, WebSocketException) as error:
            raise UnreachableError(f"{self._base}{path} cannot be reached: {error}") from None

    def _hold_presence(self) -> None:
        """Stay connected like an open page, so that the station leaves control to this user."""
        while not self._closing.is_set():
            try:
                with self._socket("/ws/events") as socket:
                    self._presence = socket
                    for _ in socket:
                        pass
            except (UnreachableError, ConnectionClosed):
                self._closing.wait(RETRY)


def thinned(samples: Iterable[dict[str, float]], rate: float) -> Iterator[dict[str, float]]:
    """Yield the mean of the samples in each interval of 1/rate s."""
    for _, some in groupby(samples, lambda one: math.floor(one["time"] * rate)):
        of = list(some)
        yield {name: math.fsum(one[name] for one in of) / len(of) for name in of[0]}


def _decoded(frame: bytes, signals: Sequence[str]) -> Iterator[dict[str, float]]:
    """Yield the samples of the series in a frame of `web.live.frames`. Raises LinkError."""
    _, series, _, _, origin, _ = HEAD.unpack_from(frame)
    if not series:
        return
    at = HEAD.size
    _, count, holes, of = SERIES.unpack_from(frame, at)
    if of > 1:
        raise LinkError("this program is too slow for every sample; stream fewer signals")
    at += SERIES.size
    times = struct.unpack_from(f"<{count}d", frame, at)
    at += 8 * count
    columns = [
        struct.unpack_from(f"<{count}f", frame, at + 4 * k * count) for k in range(len(signals))
    ]
    at += (4 * count * len(signals) + 7) // 8 * 8
    missing = set(struct.unpack_from(f"<{2 * holes}d", frame, at)[::2])
    for stamp, *values in zip(times, *columns, strict=True):
        if stamp not in missing:
            yield {"time": origin + stamp, **dict(zip(signals, values, strict=True))}


def _reason(answer: httpx.Response) -> str:
    """Return why a request was refused, in the server's words."""
    try:
        return str(answer.json()["error"])
    except (ValueError, KeyError, TypeError):
        return f"{answer.request.url.path}: {answer.status_code} {answer.reason_phrase}"
