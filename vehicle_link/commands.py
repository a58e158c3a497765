"""The commands to a vehicle and its station: each is declared only here and in its .srv file.

The request class of a row defines what a command carries. The services, the commands that the
station forwards, those that comms serves and passes to the flight process's mailbox, and the
page's routes are all derived from these rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, Literal

import msgspec
from pydantic import Field

from quadrotor.parameter_description import ParameterValue

Place = Literal["vehicle", "station", "simulator"]


def one_of(*choices: str) -> Any:
    """Return the annotation of a text that may only have these values."""
    extra: dict[str, Any] = {"enum": list(choices)}
    return Field(pattern=f"^({'|'.join(choices)})$", json_schema_extra=extra)


BRAKING = "braking: "
"""Beginning, for people, of the event with which a vehicle brakes by its own decision."""


class EventKind(StrEnum):
    """Kinds of an event, for programs; most events have none.

    They travel in the field `function` of rcl_interfaces/Log.
    """

    BRAKING = "braking"
    """The vehicle brakes by its own decision."""
    DELAYED = "delayed"
    """The event is of a time when the vehicle received no station."""
    ACT = "act"
    """A person did or asked for something."""


class Request(msgspec.Struct, frozen=True):
    """The contents of a command; the fields are those of its .srv. The annotated bounds are checked
    where a page's request arrives; the process that executes the command checks all values.
    """

    request_id: str
    requester: str


class Arm(Request, frozen=True, tag="arm"):
    """Let the motors turn."""


class Disarm(Request, frozen=True, tag="disarm"):
    """Stop the motors on the ground."""


class StartBehavior(Request, frozen=True, tag="start_behavior"):
    """Start a behavior; the vehicle checks its arguments."""

    name: Annotated[str, Field(min_length=1, max_length=64)]
    arguments: dict[str, ParameterValue] = {}


class Emergency(Request, frozen=True, tag="emergency"):
    """Command an emergency: `land` descends at once as `safety.emergency_land` specifies and is
    open to every requester; `cut` stops the motors.

    The answer is sent once the vehicle has accepted; whether it acts is shown by `emergency`.
    """

    action: Annotated[str, one_of("land", "cut")]


class ChangeParameters(Request, frozen=True, tag="change_parameters"):
    """Change parameters, all or none."""

    parameters: dict[str, ParameterValue]


class Bench(Request, frozen=True, tag="bench"):
    """Turn one motor alone; see vehicle.flight.motor_bench."""

    motor: Annotated[int, Field(ge=0, le=4)]  # 0 ends
    reference: Annotated[int, Field(ge=0, le=255)]  # counts
    secured: bool


class Record(Request, frozen=True, tag="record"):
    """Start or end a run by hand."""

    start: bool


class ExpectMove(Request, frozen=True, tag="expect_move"):
    """Expect to be put elsewhere within seconds, motors off: that is no fault of the tracker."""


class Simulation(Request, frozen=True, tag="simulation"):
    """Service a simulated vehicle whose motors are off: `swap_battery` installs a full battery,
    `reset` moves the vehicle back to where it started, with a full battery.
    """

    action: Annotated[str, one_of("swap_battery", "reset")]


@dataclass(frozen=True, slots=True)
class Command:
    """One row of the table of commands.

    Attributes:
        srv: the type of its service, below quadlab_msgs/srv.
        at: which process executes it.
        is_forwarded: whether the station forwards it there.
        patience: seconds to wait for the answer; long enough for a late one to report the outcome.
        tries: how often it is sent in all under one id, `patience` apart. 1 for commands that move
            the vehicle, which must not be executed late.
        at_once: how many requests the vehicle answers concurrently.
        has_route: whether the page has `POST /api/commands/NAME`.
        answers: fields of its answer that the page gets.
    """

    request: type[Request]
    srv: str
    at: Place = "vehicle"
    is_forwarded: bool = True
    patience: float = 1.0
    tries: int = 1
    at_once: int = 1
    has_route: bool = True
    answers: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return str(self.request.__struct_config__.tag)

    @property
    def service(self) -> str:
        """Return the type of the command's service."""
        return f"quadlab_msgs/srv/{self.srv}"

    @property
    def address(self) -> str:
        """Return the name, in the vehicle's namespace, of the service that executes the command."""
        return self.name if self.at == "vehicle" else f"{self.at}/{self.name}"


_ROWS = (
    Command(Arm, "Command", patience=3.0),
    Command(Disarm, "Command", patience=3.0),
    Command(StartBehavior, "StartBehavior", patience=3.0),
    # A cut must not wait for a landing that the flight process does not answer.
    Command(Emergency, "Emergency", at_once=4),
    Command(ChangeParameters, "ChangeParameters", tries=5, has_route=False),
    Command(ExpectMove, "Command", has_route=False),
    Command(Bench, "Bench", is_forwarded=False, has_route=False),
    Command(Record, "Record", "station", is_forwarded=False, answers=("run_id",)),
    Command(Simulation, "Simulation", "simulator"),
)

COMMANDS: dict[str, Command] = {command.name: command for command in _ROWS}
"""Commands by name."""
