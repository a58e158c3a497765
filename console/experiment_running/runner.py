"""Experiments at the station: one at a time, in a thread, on whatever vehicle is connected.

A person's command always wins: it ends the experiment before it is passed on. The run is the one
the recorder makes of every flight; it is judged by a process of its own after touch-down.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from console.catalogue import Catalogue
from console.experiment_running import state as phases
from console.experiment_running.evaluation import MODULE, Job, judge
from console.experiment_running.live_client import SETTLE, LiveClient, VehicleServices
from console.experiment_running.run_files import LOOK, RunFiles, Settings
from console.experiment_running.service import ExperimentService
from console.experiment_running.state import ExperimentState
from console.experiment_running.stick_takeover import StickTakeover
from console.experiment_running.vehicle import VehicleFeed
from console.experiments.client import Experiment, ExperimentEndedError
from console.outbox import Outbox
from console.recorder import Recorder
from console.sticks import StickOrder
from console.vehicle_parameters import VehicleParameters
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from vehicle_link.heartbeat import LinkState
from vehicle_link.node import Node

log = logging.getLogger(__name__)

OFTEN, SELDOM = 4, 20
"""Beats (50 ms) between two statuses, while an experiment runs and otherwise."""
EVALUATION = 60.0
"""s for the evaluation, and as much again as the flight is long."""
INFO, WARN = 20, 30
_BY_STICKS = "the sticks took over"


class ExperimentRunner:
    """Serves `/<vehicle>/station/experiment` and sends `experiment_status`.

    Args:
        settings: the station's stick timeout and the recorder's time after disarming, s.
        asked: told (command, requester) of each command, the experiment's own included.
        module: what judges a run.
    """

    def __init__(
        self,
        node: Node,
        vehicle: str,
        link_state: Callable[[], LinkState],
        vehicle_ns: Callable[[], int],
        outbox: Outbox,
        parameters: VehicleParameters,
        recorder: Recorder,
        catalogue: Catalogue,
        settings: Settings,
        asked: Callable[[str, str], None],
        permit: Callable[[str, str], None],
        module: str = MODULE,
    ) -> None:
        self.feed = VehicleFeed(parameters)
        self.link_state, self.vehicle_ns, self.joy = link_state, vehicle_ns, outbox.joy
        self.asked, self.permit = asked, permit
        self._vehicle = vehicle
        self._outbox, self._recorder = outbox, recorder
        self._settings, self._module = settings, module
        self._services = VehicleServices(node)
        self._lock = threading.RLock()
        self._sending = threading.Lock()
        self._state = ExperimentState()
        self._client: LiveClient | None = None
        self._thread: threading.Thread | None = None
        self._stopped_by = ""
        self._cancelled = threading.Event()
        self._files = RunFiles(recorder, catalogue, lambda: settings()[1], self._cancelled)
        self._takeover = StickTakeover()
        ExperimentService(node, vehicle, self)

    # ------------------------------------------------------------------ the service
    def start(self, experiment: Experiment, requester: str) -> None:
        """Begin. Raises RefusedError with the reason; then nothing was sent."""
        with self._lock:
            if self._state.running:
                raise RefusedError(
                    f"{self._state.name} is running, started by {self._state.requester}; "
                    "stop it first"
                )
            if self.link_state() is LinkState.LOST:
                raise RefusedError("the link to the vehicle is lost; nothing was started")
            if (mode := self.feed.mode) != "ready":
                raise RefusedError(
                    f"the vehicle is {mode or 'silent'}; an experiment starts on the ground with "
                    "the motors off (mode ready)"
                )
            self._stopped_by = ""
            self._cancelled.clear()
            self._takeover.begin()
            self._state = ExperimentState(
                experiment.name, phases.FLYING, "starting", requester, experiment.planned,
                started=time.monotonic(),
            )  # fmt: skip
            self._client = LiveClient(self._services, self.feed, self, requester)
            self._thread = threading.Thread(
                target=self._run, args=(experiment, self._client), name="experiment", daemon=True
            )
            self._thread.start()
        self._outbox.say(INFO, f"experiment {experiment.name} by {requester}")
        self._send()

    def finish(self, requester: str) -> None:
        """End the manoeuvre now, hand back, land, judge. Raises RefusedError."""
        with self._lock:
            if self._client is None or self._state.phase not in phases.IN_THE_AIR:
                raise RefusedError("no experiment is flying, so there is nothing to finish")
            self._state.phase = phases.FINISHING
            self._client.finish()
        self._outbox.say(INFO, f"experiment finishes, asked by {requester}")
        self._send()

    def stop(self, requester: str) -> None:
        """Command no more: brake and hover, or stop judging. Raises RefusedError."""
        with self._lock:
            if not self._state.running:
                raise RefusedError("no experiment is running, so there is nothing to stop")
            self._stopped_by = requester
            self._cancelled.set()
            client = self._client
        if client is not None:
            client.end(ExperimentEndedError(f"stopped by {requester}"))

    # ------------------------------------------------------------------ others command
    def commanded(self, command: str, requester: str) -> None:
        """Somebody commands the vehicle, before it is passed on; parameters are no command."""
        client = self._client
        if client is not None and command != "change_parameters":
            patience = 0.0 if command == "emergency" else SETTLE
            why = f"{requester or 'somebody'} took over with {command.replace('_', ' ')}"
            client.end(ExperimentEndedError(why), taken_over=True, patience=patience)
        self.asked(command, requester)

    def passes(self, order: StickOrder) -> bool:
        """Whether a person's stick order goes to the vehicle; deflected ones take over, once."""
        takes_over, client = self._takeover.seen(order), self._client
        if client is None or client.taken_over:
            return True
        if client.pilot:
            self._takeover.by_hand()
            return True
        if takes_over:
            client.end(ExperimentEndedError(_BY_STICKS), taken_over=True)
            threading.Thread(
                target=self._obey_sticks, args=(client,), name="take-over", daemon=True
            ).start()
            return True
        return False

    def _obey_sticks(self, client: LiveClient) -> None:
        """Beside the sticks, which must not wait for an answer."""
        # Behind the experiment's last command, should one be on its way.
        client.end(ExperimentEndedError(_BY_STICKS), taken_over=True, patience=SETTLE)
        try:
            self._services.call("start_behavior", "the sticks", name="velocity", arguments=[])
        except QuadlabError as error:
            self._outbox.say(WARN, f"{_BY_STICKS}, but: {error}")

    # ------------------------------------------------------------------ the station's beat
    def tick(self, count: int) -> None:
        """At each beat."""
        client = self._client
        if client is not None:
            client.tick()
        with self._lock:
            running = self._state.running
            if self._state.phase in phases.IN_THE_AIR and client is not None and client.armed:
                self._state.run_id = self._recorder.run_id or self._state.run_id
        if count % (OFTEN if running else SELDOM) == 0:
            self._send()

    def close(self) -> None:
        self._cancelled.set()
        if (client := self._client) is not None:
            client.end(ExperimentEndedError("the station stops"), taken_over=True)
        if self._thread is not None:
            self._thread.join(1.0)

    # ------------------------------------------------------------------ what the client needs
    def stick_timeout(self) -> float:
        return self._settings()[0]

    def step(self, text: str) -> None:
        with self._lock:
            changed, self._state.step = self._state.step != text, text
        if changed:
            self._send()

    # ------------------------------------------------------------------ the thread
    def _run(self, experiment: Experiment, client: LiveClient) -> None:
        phase, reason = phases.FAILED, ""
        try:
            self.feed.fetch()
            for _ in self._files.until_free():
                self.step("waiting for the end of the run before")
                client.wait(LOOK)
            experiment.fly(client)
        except ExperimentEndedError as error:
            phase, reason = phases.STOPPED, str(error)
        except LinkError as error:
            phase, reason = phases.STOPPED, str(error)
            client.end(error)
        except QuadlabError as error:
            phase, reason = phases.FAILED if client.armed else phases.REFUSED, str(error)
        except Exception as error:
            log.exception("experiment %s", experiment.name)
            reason = f"a defect of the experiment, see the station's log: {error!r}"
        try:
            if reason:
                self._leave(client, reason, phase)
            else:
                self._judge(experiment)
        except Exception as error:
            log.exception("experiment %s", experiment.name)
            self._end(phases.FAILED, f"a defect of the station, see its log: {error!r}")
        finally:
            self._client = None

    def _leave(self, client: LiveClient, reason: str, phase: str) -> None:
        """It ended before its end: whatever flies is told to hover, unless a person flies it."""
        if not client.armed or self.link_state() is LinkState.LOST:
            self._end(phase, reason)
            return
        client.end(ExperimentEndedError(reason))
        held = client.hold(self._stopped_by or self._state.requester)
        self._end(phase, f"{reason}; {held}" if held else reason)

    def _judge(self, experiment: Experiment) -> None:
        self._client = None  # it flies no more: commands take nothing over
        with self._lock:
            self._state.phase, run_id = phases.EVALUATING, self._state.run_id
        self.step("waiting for the run's file")
        try:
            path = self._files.closed(run_id)
            self.step("judging the run")
            elapsed = time.monotonic() - self._state.started
            done = judge(Job(experiment, path, EVALUATION + elapsed), self._cancelled, self._module)
        except QuadlabError as error:
            phase = phases.STOPPED if self._cancelled.is_set() else phases.FAILED
            kept = f"; run {run_id} is kept" if run_id else ""
            self._end(phase, f"not judged: {error}{kept}")
            return
        with self._lock:
            self._state.verdict = done.result.verdict
            self._state.metrics, self._state.limits = done.result.metrics, done.result.limits
            self._state.reports = done.files
        self._end(done.result.verdict, done.problem)

    def _end(self, phase: str, reason: str) -> None:
        with self._lock:
            self._state.phase, self._state.reason, self._state.step = phase, reason, ""
            self._state.ended = time.monotonic()
            name = self._state.name
        good = phase == phases.PASSED
        self._outbox.say(
            INFO if good else WARN, f"experiment {name}: {phase}{': ' if reason else ''}{reason}"
        )
        self._send()

    def _send(self) -> None:
        client, stamp_ns = self._client, self.vehicle_ns()
        with self._sending:  # what is sent later is newer
            with self._lock:
                message = self._state.message(stamp_ns, client is not None and client.pilot)
            try:
                self._outbox.message("experiment_status", message, stamp_ns)
            except LinkError:
                log.debug("the session is closed", exc_info=True)
