"""Experiments at the station: one at a time, in a thread, on whatever vehicle is connected.

A person's command always wins: it ends the experiment before it is passed on. The run is the one
that the recorder makes of every flight, or from the first guided step on; a separate process
evaluates it afterwards.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from console.calibrations import Calibrations
from console.catalogue.catalogue import Catalogue
from console.commands.stick_watchdog import StickOrder
from console.context import StationContext
from console.evaluation.result import FAILED
from console.experiment_running import state as phases
from console.experiment_running.decision import Decisions
from console.experiment_running.evaluation import judge_run
from console.experiment_running.live_client import LiveClient
from console.experiment_running.live_commands import SETTLE, TRIES, USED
from console.experiment_running.readings_feed import ReadingsFeed
from console.experiment_running.run_files import LOOK, RunFiles
from console.experiment_running.service import ExperimentService
from console.experiment_running.simulated_hand import SimulatedHand
from console.experiment_running.state import ExperimentState
from console.experiment_running.status_publisher import ExperimentStatusPublisher
from console.experiment_running.stick_takeover import StickTakeover
from console.experiment_running.user_files import FOLDER, UserFiles
from console.experiment_running.vehicle import VehicleFeed
from console.experiments.client import Experiment, ExperimentEndedError
from console.experiments.watched import fly
from console.link.outbox import INFO, WARN
from console.parameters.vehicle import VehicleParameters
from console.runs.runs import RunManager
from quadrotor.errors import LinkError, QuadlabError, RefusedError, StorageError
from vehicle_link.clock import monotonic
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState

log = logging.getLogger(__name__)

_BY_STICKS = "the sticks took over"


class ExperimentRunner:
    """Serves `/<vehicle>/station/experiment` and publishes `experiment_status`.

    Args:
        asked: called with (command, requester) of each command, including the experiment's own.
    """

    def __init__(
        self,
        context: StationContext,
        parameters: VehicleParameters,
        runs: RunManager,
        calibrations: Calibrations,
        catalogue: Catalogue,
        asked: Callable[[str, str], None],
        permit: Callable[[str, str], None],
    ) -> None:
        self.feed, self.readings = VehicleFeed(parameters), ReadingsFeed()
        node, vehicle, outbox = context.node, context.vehicle, context.outbox
        self.link_state, self.vehicle_ns = context.link.state, context.link.vehicle_ns
        self.joy = outbox.joy
        self.asked, self.permit = asked, permit
        self._vehicle = vehicle
        self._runs, self._calibrations = runs, calibrations
        self._station = context.parameters
        self._services = {name: node.client(name, SERVICES[name]) for name in USED}
        self._hand = SimulatedHand(node, vehicle)
        self._client: LiveClient | None = None
        self._board = ExperimentStatusPublisher(outbox, self.vehicle_ns, lambda: self._pilot)
        self._lock = self._board.lock
        self.tell = self._board.tell
        decisions = Decisions(self._board, self._services["calibrate"], calibrations, catalogue)
        self.accept, self.reject = decisions.accept, decisions.reject
        self._thread: threading.Thread | None = None
        self._stopped_by = ""
        self._cancelled = threading.Event()
        self._files = RunFiles(runs.recorder, catalogue, self._station, self._cancelled)
        self._takeover = StickTakeover()
        self._user_files = UserFiles(catalogue.folder.parent / FOLDER, vehicle)
        ExperimentService(node, vehicle, self, self._user_files)

    @property
    def _state(self) -> ExperimentState:
        return self._board.state

    @property
    def _pilot(self) -> bool:
        client = self._client
        return client is not None and client.pilot

    # ------------------------------------------------------------------ the service
    def check_free(self) -> None:
        """Raise RefusedError while an experiment runs."""
        with self._lock:
            if self._state.running:
                raise RefusedError(
                    f"{self._state.name} is running, started by {self._state.requester}; "
                    "stop it first"
                )

    def start(self, experiment: Experiment, requester: str) -> None:
        """Start an experiment. Raises RefusedError with the reason; then nothing was sent."""
        mode = self.feed.await_mode()
        with self._lock:
            self.check_free()
            if self.link_state() is LinkState.LOST:
                raise RefusedError("the link to the vehicle is lost; nothing was started")
            if mode != "ready":
                raise RefusedError(
                    f"the vehicle is {mode or 'silent'}; an experiment starts on the ground with "
                    "the motors off (mode ready)"
                )
            self._stopped_by = ""
            self._cancelled.clear()
            self._takeover.begin()
            self._board.state = ExperimentState(
                experiment.name,
                phases.FLYING,
                "starting",
                requester,
                experiment.planned,
                started=monotonic(),
            )
            self._client = LiveClient(
                self._services, self.feed, self.readings, self._hand, self, requester
            )
            self._thread = threading.Thread(
                target=self._run, args=(experiment, self._client), name="experiment", daemon=True
            )
            self._thread.start()
        self._board.say(INFO, f"experiment {experiment.name} started by {requester}")
        self._board.send()

    def finish(self, requester: str) -> None:
        """End the manoeuvre now, hand back, land, judge. Raises RefusedError."""
        with self._lock:
            if self._client is None or self._state.phase not in phases.IN_THE_AIR:
                raise RefusedError("no experiment is flying, so there is nothing to finish")
            self._state.phase = phases.FINISHING
            self._client.finish()
        self._board.say(INFO, f"experiment ends early, requested by {requester}")
        self._board.send()

    def stop(self, requester: str) -> None:
        """Stop the experiment: brake and hover, or stop the evaluation. Raises RefusedError."""
        with self._lock:
            if not self._state.running:
                raise RefusedError("no experiment is running, so there is nothing to stop")
            self._stopped_by = requester
            self._cancelled.set()
            client = self._client
        if client is not None:
            client.end(ExperimentEndedError(f"stopped by {requester}"))

    def confirm(self, question: str, requester: str) -> None:
        """Confirm the question, the present one if it is empty. Raises RefusedError."""
        with self._lock:
            asked, client = self._state.question, self._client
            if not asked or client is None:
                raise RefusedError("no question is open")
            if question not in ("", asked):
                raise RefusedError(f"another question is open now: {asked}")
            self._state.question = ""
        self._board.say(INFO, f"{requester} confirmed: {asked}")
        client.confirmed()

    # ------------------------------------------------------------------ others command
    def commanded(self, command: str, requester: str) -> None:
        """End the experiment before a person's command is passed on; parameters do not count."""
        client = self._client
        if client is not None and command != "change_parameters":
            patience = 0.0 if command == "emergency" else SETTLE
            why = f"{requester or 'someone'} took over with {command.replace('_', ' ')}"
            client.end(ExperimentEndedError(why), taken_over=True, patience=patience)
        self.asked(command, requester)

    def braked(self, why: str) -> None:
        """End the experiment because the vehicle brakes by itself: the rest is not flown."""
        client = self._client
        if client is not None and client.armed:
            client.end(ExperimentEndedError(f"the vehicle braked by itself: {why}"))

    def passes(self, order: StickOrder) -> bool:
        """Return whether a person's sticks are sent to the vehicle; deflected, they take over."""
        takes_over, client = self._takeover.seen(order), self._client
        if client is None or client.taken_over:
            return True
        if client.pilot:
            self._takeover.by_hand()
            return True
        if takes_over:
            client.end(ExperimentEndedError(_BY_STICKS), taken_over=True)
            threading.Thread(
                target=self._hand_over_to_sticks, args=(client,), name="take-over", daemon=True
            ).start()
            return True
        return False

    def _hand_over_to_sticks(self, client: LiveClient) -> None:
        """Take over by the sticks in a separate thread, as they must not wait for an answer."""
        # After the experiment's last command, if one is in progress.
        client.end(ExperimentEndedError(_BY_STICKS), taken_over=True, patience=SETTLE)
        try:
            self._services["start_behavior"].ask(
                "the sticks", tries=TRIES, name="velocity", arguments=[]
            )
        except QuadlabError as error:
            self._board.say(WARN, f"{_BY_STICKS}, but: {error}")

    # ------------------------------------------------------------------ the station's heartbeat
    def tick(self, count: int) -> None:
        """Advance the experiment at each heartbeat."""
        client = self._client
        if client is not None:
            client.tick()
        with self._lock:
            if self._state.phase in phases.IN_THE_AIR and client is not None and client.armed:
                self._state.run_id = self._runs.recorder.run_id or self._state.run_id
        self._board.tick(count)

    def close(self) -> None:
        self._user_files.close()
        self._cancelled.set()
        if (client := self._client) is not None:
            client.end(ExperimentEndedError("the station is stopping"), taken_over=True)
        if self._thread is not None:
            self._thread.join(1.0)

    # ------------------------------------------------------------------ what the client needs
    def stick_timeout(self) -> float:
        return self._station.sticks.timeout

    def step(self, text: str) -> None:
        self._board.set(step=text)

    def ask(self, question: str) -> None:
        self._board.set(question=question)

    def record(self) -> None:
        """Record a run from now on, whether motors are on or off. Raises RefusedError."""
        try:
            run_id = self._runs.hold(self._state.requester)
        except StorageError as error:
            raise RefusedError(f"no run can be recorded for judging: {error}") from error
        self._board.set(run_id=run_id)

    # ------------------------------------------------------------------ the thread
    def _run(self, experiment: Experiment, client: LiveClient) -> None:
        phase, reason = FAILED, ""
        try:
            self.feed.fetch()
            self._hand.begin(client.requester)
            for _ in self._files.until_free():
                self.step("waiting for the end of the previous run")
                client.wait(LOOK)
            fly(experiment, client)
        except (ExperimentEndedError, LinkError) as error:
            phase, reason = phases.STOPPED, str(error)
            if isinstance(error, LinkError):
                client.end(error)
        except QuadlabError as error:
            phase, reason = FAILED if client.has_begun else phases.REFUSED, str(error)
        except Exception as error:
            log.exception("experiment %s", experiment.name)
            reason = f"a defect of the experiment, see the station's log: {error!r}"
        try:
            for problem in client.close():
                self._board.say(WARN, f"experiment {experiment.name}: {problem}")
            self._runs.release()
            self._calibrations.changed()
            if reason:
                self._end_early(client, reason, phase)
            else:
                self._client = None  # it no longer flies: commands take over nothing
                judge_run(experiment, self._board, self._files, self._cancelled)
        except Exception as error:
            log.exception("experiment %s", experiment.name)
            self._board.end(FAILED, f"a defect of the station, see its log: {error!r}")
        finally:
            self._client = None

    def _end_early(self, client: LiveClient, reason: str, phase: str) -> None:
        """End early: command a vehicle in flight to hover, unless a person flies it."""
        if not client.armed or self.link_state() is LinkState.LOST:
            self._board.end(phase, reason)
            return
        client.end(ExperimentEndedError(reason))
        held = client.hold(self._stopped_by or self._state.requester)
        self._board.end(phase, f"{reason}; {held}" if held else reason)
