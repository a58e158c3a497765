"""Commands and waits of an experiment over the station's link.

A command by a person ends the experiment: from then on it sends nothing. So does a lost link; the
vehicle then brakes and lands by itself. So does a vehicle that has started anew.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, cast

from console.commands.stick_watchdog import StickWatchdog
from console.experiment_running.vehicle import VehicleFeed
from console.experiments.client import VehicleView
from quadrotor.errors import LinkError, QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.clock import monotonic
from vehicle_link.messages.records import Answer
from vehicle_link.parameters.messages import from_parameters, to_parameters
from vehicle_link.transport.client import TIMEOUT, ServiceClient
from vehicle_link.transport.heartbeat import LinkState

if TYPE_CHECKING:
    from console.experiment_running.runner import ExperimentRunner
    from vehicle_link.topics.typed_tables import Ask

Services = Mapping[str, ServiceClient[Answer]]
"""Clients of the vehicle's services in USED."""
USED = ("arm", "disarm", "start_behavior", "change_parameters", "calibrate", "bench")
TRIES = 2
LOOK = 0.02
"""s, least time between two checks of a condition."""
IDLE = 0.1
"""s between two checks while no status arrives."""
SHOWN = 0.5
"""s for the status to show an accepted command."""
SETTLE = 0.05
"""Seconds that a person's command waits for a command of the experiment that is in progress."""


class LiveCommands:
    """The commands of a running experiment, for `console.experiments.client.Client`.

    Args:
        requester: who started it; the commands are sent in this person's name.
    """

    has_pilot = True

    def __init__(
        self, services: Services, feed: VehicleFeed, runner: ExperimentRunner, requester: str
    ) -> None:
        self._services, self._feed, self._runner = services, feed, runner
        self.requester = requester
        self._instance = feed.instance
        self._sending = threading.Lock()
        self._ended: QuadlabError | None = None
        self._taken_over = threading.Event()
        self._finish = threading.Event()
        self._watchdog = StickWatchdog()
        self._watchdog_lock = threading.Lock()
        self._last_check = monotonic()
        self._call = cast("Ask", self._asked)
        self.pilot = False
        """True while a person flies with the sticks."""
        self.armed = False
        """True once the motors have been started."""

    # ------------------------------------------------------------------ from other threads
    def finish(self) -> None:
        self._finish.set()
        self._feed.wake()

    def end(self, why: QuadlabError, *, taken_over: bool = False, patience: float = 0.0) -> None:
        """Refuse all commands from now on; waits raise. The first reason is kept.

        Args:
            taken_over: by a person; then not even `hold` sends anything.
            patience: s to wait for a command that is in progress.
        """
        self._ended = self._ended or why
        if taken_over:
            self._taken_over.set()
        self._feed.wake()
        if patience and self._sending.acquire(timeout=patience):
            self._sending.release()

    @property
    def taken_over(self) -> bool:
        """Return whether a person has sent a command since, or flies with the sticks."""
        return self._taken_over.is_set()

    def tick(self) -> None:
        """Drop the sticks when the experiment no longer updates them; called periodically."""
        with self._watchdog_lock:
            order = self._watchdog.tick(monotonic(), self._runner.stick_timeout())
        if order is not None and self._ended is None and not self.pilot:
            self._runner.joy(order.axes, order.enabled)

    # ------------------------------------------------------------------ the client API
    @property
    def finished(self) -> bool:
        return self._finish.is_set()

    def pilot_flies(self, on: bool) -> None:
        self.pilot = on
        if on:
            self._runner.step("flown by hand")

    def view(self) -> VehicleView:
        self._check()
        return self._feed.view()

    def arm(self) -> None:
        self._runner.step("arming")
        self._runner.asked("arm", self.requester)
        self.armed = True
        try:
            self._call("arm")
        except RefusedError:
            self.armed = False
            raise
        self._shown("")

    def start(self, behavior: str, **arguments: ParameterValue) -> None:
        self._runner.step(behavior.replace("_", " "))
        self._call("start_behavior", name=behavior, arguments=to_parameters(arguments))
        self._shown(behavior)

    def change(self, values: dict[str, ParameterValue]) -> None:
        if not values:
            return
        asked = _summary(values)
        self._runner.step(asked)
        try:
            response = self._call("change_parameters", parameters=to_parameters(values))
        except RefusedError as error:
            self._runner.step(f"{asked}: {error}")
            raise
        self._feed.applied(from_parameters(response.applied), int(response.revision))

    def parameter(self, name: str) -> ParameterValue:
        return self._feed.parameter(name)

    def sticks(self, axes: Sequence[float]) -> None:
        forward, left, up, yaw = (float(axis) for axis in axes)
        now, timeout = monotonic(), self._runner.stick_timeout()
        with self._watchdog_lock:
            if self._watchdog.dropped:  # released and pressed again
                self._watchdog.feed((0.0, 0.0, 0.0, 0.0), False, now, timeout)
            order = self._watchdog.feed((forward, left, up, yaw), True, now, timeout)
        with self._sending:
            self._check()
            self._runner.joy(order.axes, order.enabled)

    def wait_until(
        self, condition: Callable[[VehicleView], bool], *, what: str, timeout: float
    ) -> None:
        self._runner.step(f"waiting for {what}")
        end = monotonic() + timeout
        while True:
            seen, looked = self._feed.news, monotonic()
            view = self.view()
            if condition(view):
                return
            if view.mode == "cut":
                raise RefusedError(f"the motors were cut while it waited for {what}")
            if looked >= end:
                raise RefusedError(
                    f"timed out after {timeout:g} s waiting for {what}; the vehicle is "
                    f"{view.mode}, {view.behavior}"
                )
            self._feed.wait_news(seen, min(IDLE, end - looked))
            self._pause(looked + LOOK)

    def wait(self, seconds: float) -> None:
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            self._check()
            self._pause(monotonic() + min(left, LOOK))
        self._check()

    # ------------------------------------------------------------------ after the end
    def hold(self, requester: str) -> str:
        """Command a vehicle whose experiment has ended to brake and hover in the air, and to stop
        the motors on the ground. Does nothing when a person has sent a command since.

        Returns the outcome as text.
        """
        view = self._feed.view()
        if self._taken_over.is_set() or not view.armed or view.mode != "armed":
            return ""
        service, outcome = ("start_behavior", "it brakes and hovers; land it")
        ask = partial(self._services[service].ask, requester, name="brake")
        if not view.airborne:
            service, outcome = ("disarm", "the motors are off")
            ask = partial(self._services[service].ask, requester)
        try:
            with self._sending:
                if self._taken_over.is_set():
                    return ""
                ask(tries=TRIES)
        except (RefusedError, LinkError) as error:
            return f"the command {service} failed: {error}"
        return outcome

    # ------------------------------------------------------------------ inside
    def _asked(self, service: str, timeout: float = TIMEOUT, **fields: object) -> Answer:
        with self._sending:
            self._check()
            client = self._services[service]
            response = client.ask(self.requester, timeout=timeout, tries=TRIES, **fields)
        self._check()
        return response

    def _shown(self, behavior: str) -> None:
        """Wait for a status newer than the answer, so that the next check does not see an old
        one.
        """
        self._feed.wait_status(behavior, self._runner.vehicle_ns(), SHOWN)
        self._check()

    def _pause(self, until: float) -> None:
        """Sleep to a time of the monotonic clock; an end is noticed at the next check."""
        left = until - monotonic()
        if left > 0.0:
            time.sleep(left)

    def _check(self) -> None:
        self._last_check = monotonic()
        if self._ended is None and self._runner.link_state() is LinkState.LOST:
            self._ended = LinkError(
                "the link to the vehicle was lost; it brakes, and lands on its own unless "
                "the link returns"
            )
        if self._ended is None and self._feed.instance != self._instance:
            self._ended = LinkError(
                "the vehicle's processes have started anew; in flight, its microcontroller lands it"
            )
        if self._ended is not None:
            raise self._ended


def _summary(values: dict[str, ParameterValue]) -> str:
    """Return a short text about parameters that are set."""
    if len(values) > 3:
        return f"setting {len(values)} parameters"
    return "setting " + ", ".join(f"{name} to {value}" for name, value in values.items())
