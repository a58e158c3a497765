"""The commands by name; each is a dataclass of options with `run() -> int`."""

from __future__ import annotations

from typing import Protocol

from quadlab.calibrate import Calibrate
from quadlab.fly import Fly
from quadlab.gains import Gains
from quadlab.link import LinkCommand
from quadlab.log import LogCommand
from quadlab.processes import Simulator, Station, Vehicle, Web
from quadlab.replay.command import Replay
from quadlab.up import Up
from quadlab.user import User


class Command(Protocol):
    def run(self) -> int:
        """Do it; the exit status. Raises QuadlabError for what the user can mend."""
        ...


COMMANDS: dict[str, type[Command]] = {
    "up": Up,
    "fly": Fly,
    "calibrate": Calibrate,
    "log": LogCommand,
    "link": LinkCommand,
    "replay": Replay,
    "gains": Gains,
    "vehicle": Vehicle,
    "simulator": Simulator,
    "station": Station,
    "web": Web,
    "user": User,
}
