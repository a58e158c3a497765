"""The gateway: what arrives from ground stations, and what each message does.

One thread reads, answers and sends; requests to the station wait in the threads of `operators`, and
their answers are delivered here. The gateway only asks: the station's lease and the vehicle decide.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from extensions.mavlink.command_protocol import Answered, CommandProtocol
from extensions.mavlink.commands import Wanted, behavior
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin
from extensions.mavlink.link import MOST, Link
from extensions.mavlink.logs import Logs
from extensions.mavlink.mission_flight import MissionFlight
from extensions.mavlink.missions import Missions
from extensions.mavlink.offboard import Offboard, Sender, set_point_of
from extensions.mavlink.operators import Connect, Operator
from extensions.mavlink.parameter_server import ParameterServer
from extensions.mavlink.peer import Peer
from extensions.mavlink.sticks import Sticks
from extensions.mavlink.telemetry import Telemetry
from extensions.mavlink.vehicle import Vehicle
from quadrotor.errors import RefusedError, StorageError
from vehicle_link.clock import monotonic_ns
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.termination_signal import Ending

PERIOD = 0.01
"""Longest wait, in s, for a message before what is due is sent."""
NOT_FLOWN = {
    "SET_ATTITUDE_TARGET": "attitude set-points are not supported; send position or velocity",
    "LOG_ERASE": "runs are deleted on the Runs page alone",
}
VIEWER = "ground stations are viewers here; start quadlab mavlink without --viewers to let them fly"
UNNAMED = (
    "unsigned messages may not command at a port where any program can send; start quadlab mavlink "
    "with udpout:ADDRESS:PORT where the ground station listens, with --passphrase FILE and sign, "
    "or with --unsigned to let everybody fly who reaches the port"
)


class Gateway:
    """Composes the parts.

    Args:
        open_link: opens the sockets; is given what to call when a ground station has left.
        connect: returns a client of the station for a requester.
        advertise: returns a publisher of a topic.
        changes, events: queues of the messages of parameter_changes and events.
        viewers: nobody may command; emergencies that land are open to all.
        say: prints a line.
    """

    def __init__(
        self,
        open_link: Callable[[Callable[[Peer], None]], Link],
        vehicle: Vehicle,
        connect: Connect,
        logs: Logs,
        advertise: Callable[[str], Sender],
        changes: queue.SimpleQueue[Any],
        events: queue.SimpleQueue[Any],
        origin: Origin,
        *,
        viewers: bool,
        say: Callable[[str], None],
    ) -> None:
        self._vehicle, self._connect, self._origin = vehicle, connect, origin
        self._events, self._viewers, self._print = events, viewers, say
        self._results: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._operators: dict[str, Operator] = {}
        self._parameters = ParameterServer(changes, self.say)
        references = advertise("external_reference")
        self._offboard = Offboard(vehicle, references, self._offboard_ended)
        self._sticks = Sticks(advertise("stick"))
        self._telemetry = Telemetry(vehicle, origin)
        self._missions = Missions(origin, self._may_upload, self.say)
        self._flight: MissionFlight | None = None
        self._commands = CommandProtocol(origin, self._do, self.say)
        self._link = open_link(self._left)
        self._handlers: dict[str, Callable[[Peer, MAVLink_message], None]] = {
            "COMMAND_LONG": self._commands.take,
            "COMMAND_INT": self._commands.take,
            "SET_POSITION_TARGET_LOCAL_NED": self._steer,
            "SET_POSITION_TARGET_GLOBAL_INT": self._steer,
            "MANUAL_CONTROL": self._steer,
            "PARAM_REQUEST_LIST": self._list_parameters,
            "PARAM_REQUEST_READ": self._read_parameter,
            "PARAM_SET": self._set_parameter,
            "LOG_REQUEST_LIST": logs.list_to,
            "LOG_REQUEST_DATA": logs.send_to,
            "LOG_REQUEST_END": logs.end,
            "TIMESYNC": self._time,
        }

    def run(self, stopping: Ending) -> None:
        """Run until `stopping`."""
        try:
            while not stopping.wait(0.0):
                self.turn(PERIOD)
        finally:
            self.close()

    def close(self) -> None:
        """Send no more references, and give up control."""
        self._offboard.end()
        for operator in self._operators.values():
            operator.close()
        self._link.close()

    def turn(self, wait: float) -> None:
        """Handle what has arrived, within `wait` s, and send what is due."""
        for peer, message in self._link.receive(wait):
            self._take(peer, message)
        while not self._results.empty():
            self._results.get()()
        self._link.forget_silent()
        now = time.monotonic()
        self._missions.tick(now)
        if self._flight is not None:
            self._flight.tick(now)
        while not self._events.empty():
            event = self._events.get()
            for message in self._telemetry.texts(str(event.msg), int(event.level)):
                self._tell(message)
        for message in self._parameters.changed():
            self._tell(message)
        for peer in self._link.peers:
            self._telemetry.send_due(peer, now)
            for line in peer.send_waiting():
                self.say(peer, line)

    def say(self, peer: Peer, line: str, level: int = 30) -> None:
        """Print a line about a ground station, and send it there as text."""
        self._link.complain(peer, line, f"{peer.name}: {line}")
        for message in self._telemetry.texts(line, level):
            peer.send(message)

    def _tell(self, message: MAVLink_message) -> None:
        for peer in self._link.peers:
            peer.send(message)

    # ------------------------------------------------------------------ messages
    def _take(self, peer: Peer, message: MAVLink_message) -> None:
        kind = message.get_type()
        if kind.startswith("MISSION_"):
            self._missions.take(peer, message, time.monotonic())
        elif kind in NOT_FLOWN and peer.is_new(kind, time.monotonic()):
            self.say(peer, NOT_FLOWN[kind])
        elif (handler := self._handlers.get(kind)) is not None:
            try:
                handler(peer, message)
            except (RefusedError, StorageError) as error:
                if not kind.startswith(("SET_", "MANUAL_")) or peer.is_new(
                    str(error), time.monotonic()
                ):
                    self.say(peer, str(error))

    def _do(self, peer: Peer, wanted: Wanted, then: Answered) -> bool:
        """Do what is wanted; `then` is called at once or later. Return whether it is known.

        Raises RefusedError.
        """
        service, fields = wanted
        if service in ("message", "period"):
            is_known = (
                self._telemetry.send(peer, **fields)
                if service == "message"
                else self._telemetry.set_period(peer, **fields)
            )
            if is_known:
                then("")
            return is_known
        if fields.get("action") != "land" and (reason := self._refusal(peer)):
            raise RefusedError(reason)
        if service == "mission":
            self._fly_mission(peer, then)
        elif service == "external":
            self._with_parameters(peer, partial(self._fly_offboard, peer, then), then)
        else:
            if service == "start_behavior":
                fields = {**fields, "arguments": to_parameters(fields["arguments"])}
            self._operator(peer.name).ask(lambda _, reason: then(reason), service, **fields)
        return True

    def _refusal(self, peer: Peer) -> str:
        """Return why a ground station may not command, "" if it may."""
        if self._viewers:
            return VIEWER
        return "" if peer.may_command else UNNAMED

    def _operator(self, name: str) -> Operator:
        if name not in self._operators:
            if len(self._operators) >= MOST:
                raise RefusedError(f"{MOST} ground stations command already; close one")
            self._operators[name] = Operator(name, self._connect, self._results)
        return self._operators[name]

    # ------------------------------------------------------------------ flights
    def _steer(self, peer: Peer, message: MAVLink_message) -> None:
        if reason := self._refusal(peer):
            raise RefusedError(reason)
        if message.get_type() == "MANUAL_CONTROL":
            self._sticks.take(peer, message)
        else:
            self._offboard.take(peer.name, set_point_of(message, self._origin, monotonic_ns()))

    def _fly_offboard(self, peer: Peer, then: Answered) -> None:
        """Send references, then ask for the behavior that flies them."""

        def answered(_: object, reason: str) -> None:
            if reason:
                self._offboard.end()
            else:
                self._offboard.accepted()
            then(reason)

        try:
            self._offboard.begin(peer.name, self._parameters.values)
            self._operator(peer.name).start(answered, self._offboard.ask)
        except RefusedError as error:
            then(str(error))

    def _offboard_ended(self, who: str, line: str) -> None:
        """Tell the end of an offboard flight; called in its thread."""

        def tell() -> None:
            for peer in self._link.peers:
                if peer.name == who:
                    self.say(peer, line)

        self._results.put(tell)

    def _fly_mission(self, peer: Peer, then: Answered) -> None:
        steps = self._missions.steps
        if not steps:
            raise RefusedError("there is no mission; upload one first")
        if self._flight is not None and not self._flight.is_over:
            raise RefusedError(f"{self._flight.who} flies a mission already")
        if steps[0].behavior == "take_off" and self._vehicle.behavior not in ("ground", ""):
            steps = steps[1:]

        def ask(name: str, arguments: dict[str, Any], answered: Answered) -> None:
            self._do(peer, behavior(name, **arguments), answered)

        said = partial(self.say, peer, level=20)
        self._flight = MissionFlight(peer.name, steps, self._vehicle, ask, self._tell, said)
        self._flight.begin(then)

    def _may_upload(self, peer: Peer) -> str:
        if reason := self._refusal(peer):
            return reason
        holder = self._vehicle.holder
        return "" if holder in ("", peer.name) else f"{holder} has control"

    def _left(self, peer: Peer) -> None:
        """Release what a ground station holds that has fallen silent.

        Nothing stops a behavior in the air; a vehicle on the ground whose motors it started is
        disarmed.
        """
        self._offboard.left(peer.name)
        if self._flight is not None and self._flight.who == peer.name:
            self._flight.end("mission ended: its ground station has left")
        if (operator := self._operators.pop(peer.name, None)) is not None:
            self._disarm_on_ground(peer, operator)
            operator.close()
        self._commands.left(peer)
        self._sticks.left(peer)

    def _disarm_on_ground(self, peer: Peer, operator: Operator) -> None:
        """Disarm a vehicle that waits on the ground, armed, for a ground station in control."""
        status = self._vehicle.status
        if status is None or status.mode != "armed" or status.airborne:
            return
        if self._vehicle.holder == peer.name:
            self._print(f"{peer.name} has left the vehicle armed on the ground: disarming")
            operator.ask(lambda _, reason: self._print(reason) if reason else None, "disarm")

    def _with_parameters(
        self, peer: Peer, then: Callable[[], None], failed: Answered | None = None
    ) -> None:
        """Call `then` when the vehicle's parameters are known."""
        if self._parameters.is_loaded:
            then()
            return

        def loaded(answer: Any, reason: str) -> None:
            if reason:
                (failed or partial(self.say, peer))(reason)
                return
            for line in self._parameters.load(*answer):
                self._print(line)
            then()

        self._operator(peer.name).start(
            loaded, lambda client: (client.descriptions(), client.parameters())
        )

    def _list_parameters(self, peer: Peer, message: MAVLink_message) -> None:
        self._with_parameters(peer, partial(self._parameters.list_to, peer))

    def _read_parameter(self, peer: Peer, message: MAVLink_message) -> None:
        self._with_parameters(peer, partial(self._parameters.read, peer, message))

    def _set_parameter(self, peer: Peer, message: MAVLink_message) -> None:
        if reason := self._refusal(peer):
            self._parameters.refuse(peer, message.param_id, reason)
            return
        operator = self._operator(peer.name)
        self._with_parameters(peer, partial(self._parameters.set, peer, operator, message))

    def _time(self, peer: Peer, message: MAVLink_message) -> None:
        if message.tc1 == 0:
            peer.send(mavlink.MAVLink_timesync_message(monotonic_ns(), message.ts1))
