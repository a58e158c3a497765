"""Flies an experiment with its preconditions and its abort rule, if it has them.

Both are optional methods of an experiment: `preconditions(view)` is called once the vehicle is
ready and before any command is sent, `abort(view)` at every check of every wait. Either returns the
problem in words, or an empty text.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, cast, runtime_checkable

from console.experiments.client import Client, Experiment, VehicleView
from console.experiments.manoeuvres import LANDING, brake, wait_ready
from console.experiments.user_file import errors_with_line
from quadrotor.errors import QuadlabError, RefusedError


class AbortedError(QuadlabError):
    """The experiment's own rule ended it; the vehicle has landed."""


@runtime_checkable
class Conditional(Protocol):
    """An experiment with preconditions on the vehicle."""

    def preconditions(self, view: VehicleView) -> str: ...


@runtime_checkable
class Abortable(Protocol):
    """An experiment with a rule that ends it."""

    def abort(self, view: VehicleView) -> str: ...


def fly(experiment: Experiment, client: Client) -> None:
    """Fly the experiment.

    Raises what `experiment.fly` raises; RefusedError when a precondition is not met; AbortedError
    with the reason once the vehicle has braked and landed; UserFileError for a mistake in a user's
    file.
    """
    with errors_with_line(experiment):
        if isinstance(experiment, Conditional):
            wait_ready(client)
            missing = experiment.preconditions(client.view())
            if missing:
                raise RefusedError(f"not started: {missing}")
        if not isinstance(experiment, Abortable):
            experiment.fly(client)
            return
        watched = cast(Client, Watched(client, experiment.abort))
        try:
            experiment.fly(watched)
        except AbortedError:
            _come_down(client)
            raise


class Watched:
    """A client whose waits check the abort rule; everything else is the client's own."""

    def __init__(self, client: Client, abort: Callable[[VehicleView], str]) -> None:
        self._client, self._abort = client, abort

    def __getattr__(self, name: str) -> object:
        return getattr(self._client, name)

    def wait_until(
        self, condition: Callable[[VehicleView], bool], *, what: str, timeout: float
    ) -> None:
        def check(view: VehicleView) -> bool:
            reason = self._abort(view)
            if reason:
                raise AbortedError(f"aborted: {reason}")
            return condition(view)

        self._client.wait_until(check, what=what, timeout=timeout)

    def wait(self, seconds: float) -> None:
        end = self._client.view().time + seconds
        self.wait_until(lambda v: v.time >= end, what="the time", timeout=seconds + 5.0)


def _come_down(client: Client) -> None:
    """Brake and land if in flight. Raises RefusedError when the vehicle refuses."""
    if client.view().airborne:
        brake(client)
        client.start("land")
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=LANDING)
