"""Manual actions at a simulated vehicle on the ground: requested by a service, run by the loop."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future

from quadrotor.errors import NoAnswerError, RefusedError
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

ACTIONS = ("swap_battery", "reset")
PATIENCE = 0.8
"""Time, in s, within which the loop has to carry out a request."""


class Attendant:
    """Queue of requests to the loop, which alone changes the plant; thread-safe."""

    def __init__(self) -> None:
        self._asked: deque[tuple[str, Future[None]]] = deque()

    def ask(self, action: str) -> None:
        """Carry out an action and wait for it.

        Raises RefusedError with the reason, NoAnswerError when the loop did not do it in time.
        """
        if action not in ACTIONS:
            raise RefusedError(
                f"simulation: unknown action {action!r:.40}; allowed: {', '.join(ACTIONS)}"
            )
        done: Future[None] = Future()
        self._asked.append((action, done))
        try:
            done.result(PATIENCE)
        except TimeoutError:
            if done.cancel():
                raise RefusedError("the simulator is busy: nothing was done; try again") from None
            raise NoAnswerError("the simulator has not answered in time") from None

    def attend(self, simulated: SimulatedVehicle) -> None:
        """Carry out the pending request; called by the loop between two steps."""
        while self._asked:
            action, done = self._asked.popleft()
            if not done.set_running_or_notify_cancel():
                continue
            try:
                simulated.swap_battery() if action == "swap_battery" else simulated.reset()
            except RefusedError as error:
                done.set_exception(error)
            else:
                done.set_result(None)
