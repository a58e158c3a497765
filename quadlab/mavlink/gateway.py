"""The gateway: what arrives from ground stations, and what each message does.

One thread reads, answers and sends; requests to the station wait in the threads of `operators`, and
their answers are delivered here. The gateway only asks: the station's lease and the vehicle decide.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from quadlab.mavlink.commands import Wanted, of_mode, wanted_of
from quadlab.mavlink.dialect import mavlink
from quadlab.mavlink.frames import Origin
from quadlab.mavlink.link import Link, Peer
from quadlab.mavlink.logs import Logs
from quadlab.mavlink.missions import MissionFlight, Missions
from quadlab.mavlink.offboard import Offboard, Sender, set_point_of
from quadlab.mavlink.operators import UNANSWERED, Operators
from quadlab.mavlink.parameter_server import ParameterServer
from quadlab.mavlink.telemetry import Telemetry
from quadlab.mavlink.vehicle import Vehicle
from quadrotor.errors import RefusedError, StorageError
from vehicle_link.clock import monotonic_ns
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.termination_signal import Ending

PERIOD = 0.01
"""Longest wait, in s, for a message before what is due is sent."""
AT_ONCE = 20
"""Messages of a list or a log that are sent to one ground station in one turn."""
REPEATED = 1.0
"""Seconds in which the same command again is a repetition: it gets the same answer."""
NOT_FLOWN = {
    "SET_ATTITUDE_TARGET": "set-points of attitude are not flown; send position or velocity",
    "SET_ACTUATOR_CONTROL_TARGET": "set-points of motors are not flown",
    "MANUAL_CONTROL": "sticks are not taken over MAVLink; use the page's",
    "LOG_ERASE": "runs are deleted on the Runs page alone",
}
VIEWER = "ground stations are viewers here; start quadlab mavlink without --viewers to let them fly"


@dataclass
class Answer:
    """The answer to a command: None while it is awaited."""

    sent: bytes
    result: int | None
    at: float


class Gateway:
    """Composes the parts.

    Args:
        open_link: opens the sockets; is given what to call when a ground station has left.
        operators: the requesters at the station.
        references: publisher of external references.
        changes, events: queues of the messages of parameter_changes and events.
        viewers: nobody may command; emergencies that land are open to all.
        say: prints a line.
    """

    def __init__(
        self,
        open_link: Callable[[Callable[[Peer], None]], Link],
        vehicle: Vehicle,
        operators: Operators,
        logs: Logs,
        references: Sender,
        changes: queue.SimpleQueue[Any],
        events: queue.SimpleQueue[Any],
        origin: Origin,
        *,
        viewers: bool,
        say: Callable[[str], None],
    ) -> None:
        self._vehicle, self._operators, self._origin = vehicle, operators, origin
        self._logs, self._events, self._viewers, self._print = logs, events, viewers, say
        self._ended: queue.SimpleQueue[tuple[str, str]] = queue.SimpleQueue()
        self._parameters = ParameterServer(changes, self.say)
        self._offboard = Offboard(vehicle, references, lambda *words: self._ended.put(words))
        self._telemetry = Telemetry(vehicle, origin)
        self._missions = Missions(origin, self._may_upload, self.say)
        self._flight: MissionFlight | None = None
        self._answers: dict[tuple[str, int], Answer] = {}
        self._link = open_link(self._left)
        self._handlers: dict[str, Callable[[Peer, Any], None]] = {
            "COMMAND_LONG": self._command,
            "COMMAND_INT": self._command,
            "SET_MODE": self._set_mode,
            "SET_POSITION_TARGET_LOCAL_NED": self._set_point,
            "SET_POSITION_TARGET_GLOBAL_INT": self._set_point,
            "PARAM_REQUEST_LIST": lambda peer, _: self._with_parameters(
                peer, partial(self._parameters.list_to, peer)
            ),
            "PARAM_REQUEST_READ": lambda peer, message: self._with_parameters(
                peer, partial(self._parameters.read, peer, message)
            ),
            "PARAM_SET": self._set_parameter,
            "LOG_REQUEST_LIST": self._list_logs,
            "LOG_REQUEST_DATA": self._send_log,
            "LOG_REQUEST_END": self._end_log,
            "TIMESYNC": self._time,
        }

    def run(self, stopping: Ending) -> None:
        """Run until `stopping`."""
        try:
            while not stopping.wait(0.0):
                self.turn(PERIOD)
        finally:
            self._offboard.end()
            self._operators.close()
            self._link.close()

    def turn(self, wait: float) -> None:
        """Handle what has arrived, within `wait` s, and send what is due."""
        for peer, message in self._link.receive(wait):
            self._take(peer, message)
        self._operators.results.deliver()
        self._link.forget_silent()
        now = time.monotonic()
        self._missions.tick(now)
        if self._flight is not None:
            self._flight.tick(now)
        texts = self._texts()
        changed = self._parameters.changed()
        for peer in self._link.peers:
            self._telemetry.send_due(peer, now)
            for message in (*texts, *changed):
                peer.send(message)
            self._send_waiting(peer)

    def say(self, peer: Peer, line: str, level: int = 30) -> None:
        """Print a line about a ground station, and send it there as text."""
        self._link.complain(peer, line, f"{peer.name}: {line}")
        for message in self._telemetry.texts(line, level):
            peer.send(message)

    # ------------------------------------------------------------------ messages
    def _take(self, peer: Peer, message: Any) -> None:
        kind = message.get_type()
        if kind.startswith("MISSION_"):
            self._missions.take(peer, message, time.monotonic())
        elif kind in NOT_FLOWN:
            if peer.is_new(kind, time.monotonic()):
                self.say(peer, NOT_FLOWN[kind])
        elif (handler := self._handlers.get(kind)) is not None:
            try:
                handler(peer, message)
            except RefusedError as error:
                self.say(peer, str(error))

    def _command(self, peer: Peer, message: Any) -> None:
        key, sent, now = (
            (peer.name, message.command),
            bytes(message.get_payload()),
            time.monotonic(),
        )
        known = self._answers.get(key)
        if known is not None and (
            known.result is None or (known.sent == sent and now - known.at < REPEATED)
        ):
            self._acknowledge(peer, message.command, known.result)
            return
        answer = self._answers[key] = Answer(sent, None, now)

        def then(result: int, reason: str = "") -> None:
            answer.result, answer.at = result, time.monotonic()
            self._acknowledge(peer, message.command, result)
            if reason:
                self.say(peer, reason)

        try:
            self._do(peer, wanted_of(message, self._origin), then)
        except RefusedError as error:
            then(mavlink.MAV_RESULT_DENIED, str(error))
        if answer.result is None:
            self._acknowledge(peer, message.command, None)

    def _set_mode(self, peer: Peer, message: Any) -> None:
        def then(result: int, reason: str = "") -> None:
            if reason:
                self.say(peer, reason)

        main, sub = message.custom_mode >> 16 & 255, message.custom_mode >> 24
        self._do(peer, of_mode(main, sub), then)

    def _do(self, peer: Peer, wanted: Wanted | None, then: Callable[..., None]) -> None:
        """Do what is wanted; `then` gets its result, at once or later. Raises RefusedError."""
        if wanted is None:
            then(mavlink.MAV_RESULT_UNSUPPORTED)
            return
        if wanted.service in ("message", "period"):
            is_known = (
                self._telemetry.send_one(peer, wanted.number)
                if wanted.service == "message"
                else self._telemetry.set_period(peer, wanted.number, wanted.microseconds)
            )
            then(mavlink.MAV_RESULT_ACCEPTED if is_known else mavlink.MAV_RESULT_UNSUPPORTED)
            return
        if self._viewers and (wanted.service, wanted.action) != ("emergency", "land"):
            raise RefusedError(VIEWER)

        def answered(_: Any, reason: str) -> None:
            then(_result(reason), reason)

        operator = self._operators.of(peer.name)
        if wanted.service == "emergency":
            operator.emergency(answered, wanted.action)
        elif wanted.service == "mission":
            self._fly_mission(peer, lambda reason: answered(None, reason))
        elif wanted.service == "external":
            self._with_parameters(
                peer,
                partial(self._fly_offboard, peer, lambda reason: answered(None, reason)),
                lambda reason: answered(None, reason),
            )
        elif wanted.service == "start_behavior":
            self._start(peer.name, wanted.name, wanted.arguments, lambda r: answered(None, r))
        else:
            operator.ask(answered, wanted.service)

    def _start(
        self, who: str, behavior: str, arguments: dict[str, Any], then: Callable[[str], None]
    ) -> None:
        self._operators.of(who).ask(
            lambda _, reason: then(reason),
            "start_behavior",
            name=behavior,
            arguments=to_parameters(arguments),
        )

    def _acknowledge(self, peer: Peer, command: int, result: int | None) -> None:
        shown = mavlink.MAV_RESULT_IN_PROGRESS if result is None else result
        peer.send(mavlink.MAVLink_command_ack_message(command, shown, 255, 0, peer.system, 0))

    # ------------------------------------------------------------------ flights
    def _set_point(self, peer: Peer, message: Any) -> None:
        try:
            if self._viewers:
                raise RefusedError(VIEWER)
            self._offboard.take(peer.name, set_point_of(message, self._origin, monotonic_ns()))
        except RefusedError as error:
            if peer.is_new(f"set-point: {error}", time.monotonic()):
                self.say(peer, str(error))

    def _fly_offboard(self, peer: Peer, then: Callable[[str], None]) -> None:
        """Send references, then ask for the behavior that flies them."""

        def answered(reason: str) -> None:
            if reason:
                self._offboard.end()
            else:
                self._offboard.accepted()
            then(reason)

        try:
            self._offboard.begin(peer.name, self._parameters.values())
        except RefusedError as error:
            then(str(error))
            return
        operator = self._operators.of(peer.name)
        operator.start(lambda _, reason: answered(reason), self._offboard.ask)

    def _fly_mission(self, peer: Peer, then: Callable[[str], None]) -> None:
        if not self._missions.steps:
            raise RefusedError("there is no mission; upload one first")
        if self._flight is not None and not self._flight.is_over:
            raise RefusedError(f"{self._flight.who} flies a mission already")
        steps = self._missions.steps
        if steps[0].behavior == "take_off" and self._vehicle.behavior not in ("ground", ""):
            steps = steps[1:]
        self._flight = MissionFlight(
            peer.name, steps, self._vehicle, partial(self._start, peer.name), self._tell,
            lambda line: self.say(peer, line, 20),
        )  # fmt: skip

        def begun(reason: str) -> None:
            if reason:
                self._flight = None
            then(reason)

        self._flight.begin(begun)

    def _may_upload(self, peer: Peer) -> str:
        holder = self._vehicle.holder
        if self._viewers:
            return VIEWER
        return "" if holder in ("", peer.name) else f"{holder} has control"

    def _left(self, peer: Peer) -> None:
        """Release what a ground station holds that has fallen silent; nothing stops a behavior."""
        self._offboard.left(peer.name)
        if self._flight is not None and self._flight.who == peer.name:
            self._flight.end("mission ended: its ground station has left")
        self._operators.left(peer.name)
        self._answers = {key: one for key, one in self._answers.items() if key[0] != peer.name}

    # ------------------------------------------------------------------ parameters, logs, time
    def _with_parameters(
        self, peer: Peer, then: Callable[[], None], failed: Callable[[str], None] | None = None
    ) -> None:
        """Call `then` when the vehicle's parameters are known."""
        if self._parameters.is_loaded:
            then()
            return

        def loaded(answer: Any, reason: str) -> None:
            if reason:
                (failed or partial(self.say, peer))(reason)
                return
            for name in self._parameters.load(*answer):
                self._print(f"parameter {name} has no short name of its own and is left out")
            then()

        self._operators.of(peer.name).start(
            loaded, lambda client: (client.descriptions(), client.parameters())
        )

    def _set_parameter(self, peer: Peer, message: Any) -> None:
        if self._viewers:
            self._parameters.refuse(peer, message.param_id, VIEWER)
            return
        operator = self._operators.of(peer.name)
        self._with_parameters(peer, partial(self._parameters.set, peer, operator, message))

    def _list_logs(self, peer: Peer, message: Any) -> None:
        try:
            peer.waiting["logs"] = iter(list(self._logs.listed(message.start, message.end)))
        except StorageError as error:
            self.say(peer, str(error))

    def _send_log(self, peer: Peer, message: Any) -> None:
        peer.waiting["log"] = self._logs.pieces(message.id, message.ofs, message.count)

    def _end_log(self, peer: Peer, message: Any) -> None:
        peer.waiting.pop("log", None)

    def _send_waiting(self, peer: Peer) -> None:
        for name, messages in list(peer.waiting.items()):
            try:
                for _ in range(AT_ONCE):
                    peer.send(next(messages))
            except StopIteration:
                del peer.waiting[name]
            except StorageError as error:
                del peer.waiting[name]
                self.say(peer, str(error))

    def _time(self, peer: Peer, message: Any) -> None:
        if message.tc1 == 0:
            peer.send(mavlink.MAVLink_timesync_message(monotonic_ns(), message.ts1))

    # ------------------------------------------------------------------ to all
    def _tell(self, message: Any) -> None:
        for peer in self._link.peers:
            peer.send(message)

    def _texts(self) -> list[Any]:
        """Return the station's events since the last turn, and the ends of offboard flights."""
        lines: list[tuple[str, int]] = []
        while not self._ended.empty():
            line, who = self._ended.get()
            self._print(f"{who}: {line}")
            lines.append((line, 30))
        while not self._events.empty():
            event = self._events.get()
            lines.append((str(event.msg), int(event.level)))
        return [message for line, level in lines for message in self._telemetry.texts(line, level)]


def _result(reason: str) -> int:
    if not reason:
        return int(mavlink.MAV_RESULT_ACCEPTED)
    is_unknown = reason.startswith(UNANSWERED)
    return int(mavlink.MAV_RESULT_FAILED if is_unknown else mavlink.MAV_RESULT_DENIED)
