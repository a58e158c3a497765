"""The kinds of boards: the paper's, those of extensions, those of packages (`quadlab.boards`).

The command line needs their names only: pydantic and numpy are imported with a board.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Protocol

import msgspec

from quadrotor.errors import UsageError
from quadrotor.extension import Board as Offered
from quadrotor.extensions import registry
from quadrotor.packaged_files import packaged
from quadrotor.similar_names import did_you_mean
from vehicle_link.serial.port import BAUD_RATE, Port

if TYPE_CHECKING:
    from quadrotor.parameter_description import ParameterValue
    from quadrotor.parameters import Parameters
    from vehicle.boards.board import Board, Traits

MIKROKOPTER = "mikrokopter"
GROUP = "quadlab.boards"


class Connect(Protocol):
    """Factory of a board from its ports and options; `rate` is its sample rate in Hz.

    `now_ns` is the clock of simulated time, None for the host's clock. `unfit` is the reason why
    its motors must not start, "" when the board matches its options.
    """

    def __call__(
        self,
        ports: Sequence[Port],
        options: Parameters | None,
        rate: int,
        now_ns: Callable[[], int] | None,
        unfit: str = "",
    ) -> Board: ...


class Check(Protocol):
    """Comparison of a board with its options before a flight; `say` receives lines for operators.

    Returns the lines that a person has to enter on the board, none when it matches. A board that
    cannot be flown is reported as one such line. What only the board knows may be added to the
    options, as a component `firmware`. Raises LinkError when it does not answer.
    """

    def __call__(
        self, port: Port, options: Parameters | None, say: Callable[[str], None]
    ) -> list[str]: ...


class Simulate(Protocol):
    """Factory of the firmware of a simulated board, a `vehicle.simulator.board_firmware`.

    `number` is that of the vehicle, from 0. Raises QuadlabError when it cannot be simulated here.
    """

    def __call__(self, options: Parameters | None, number: int) -> object: ...


class Kind(msgspec.Struct, frozen=True):
    """Kind of board: the object to which the declaration of an extension or package refers."""

    traits: Traits
    connect: Connect
    options: type[Parameters] | None = None
    live: bool = False  # whether it applies changes of its options at once
    rate: int = 500  # default sample rate, Hz
    bauds: tuple[int, ...] = (BAUD_RATE, BAUD_RATE)  # for its ports, of which it may have fewer
    example: str = "/dev/ttyS0,/dev/ttyS1"  # of its ports
    poll_ms: int = 50  # longest time between two `service` calls; a polled board needs less
    check: Check | None = None  # None: it has no settings that can be wrong
    simulated: dict[str, ParameterValue] = {}  # values of the simulated vehicle with this board
    station: dict[str, ParameterValue] = {}  # values of its station in `quadlab up`
    simulate: Simulate | None = None  # None: it cannot be simulated
    udp_port: int | None = None  # of the first one that is simulated; None: a pseudo-terminal
    build: Callable[[], object] | None = None  # builds what its simulation needs

    def traits_with(self, options: Parameters | None) -> Traits:
        """Return its traits with these options, whose `level` is where the law ends."""
        level = getattr(options, "level", "")
        if not level:
            return self.traits
        from vehicle.boards.board import CommandKind

        first = CommandKind[level.upper()]
        others = tuple(one for one in self.traits.takes if one is not first)
        gain = getattr(options, "angle_gain", self.traits.angle_gain)
        return msgspec.structs.replace(self.traits, takes=(first, *others), angle_gain=gain)

    @property
    def is_asked(self) -> bool:
        """Return whether the board gives samples only on request."""
        return self.poll_ms * self.rate < 1000

    @property
    def simulated_parameters(self) -> dict[str, ParameterValue]:
        """Return the values of a simulated flight that replace the defaults."""
        simulator = self.simulated | {"imu_rate": self.rate}
        named = {f"simulator.{name}": value for name, value in simulator.items()}
        return self.traits.parameters | named

    def configured(self, values: Mapping[str, ParameterValue]) -> Parameters | None:
        """Return its options with these values, None if it has none. Raises ParameterError."""
        if self.options is None:
            return None
        from quadrotor.parameters import ParameterStore

        options = self.options()
        ParameterStore(options).preset(values)
        return options


def find_kind(name: str) -> Kind:
    """Return the kind of board with this name. Raises UsageError when it is unknown."""
    if name == MIKROKOPTER:
        here: Kind = import_module(f"{__package__}.mikrokopter.microcontroller").KIND
        return here
    extending, offered = registry().offers(Offered, taken=(MIKROKOPTER,)), packaged(GROUP)
    if name in extending:
        theirs: Kind = extending[name].load()
        return theirs
    if name not in offered.names:
        there_are = ", ".join([MIKROKOPTER, *extending, *sorted(offered.names)])
        meant = did_you_mean(name, [MIKROKOPTER, *extending, *offered.names], after=" ")
        raise UsageError(f"--board {name!r} is not known; {meant}there are {there_are}")
    kind = offered[name].load()
    if not isinstance(kind, Kind):
        raise UsageError(f"--board {name}: {offered[name].value} is not a vehicle.boards.kind.Kind")
    return kind
