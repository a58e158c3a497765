"""The commands by name; each is a dataclass of options with `run() -> int`."""

from __future__ import annotations

from typing import Protocol

from quadlab.commands.calibrate import Calibrate
from quadlab.commands.camera import Camera
from quadlab.commands.fly import Fly
from quadlab.commands.gains import Gains
from quadlab.commands.link import LinkCommand
from quadlab.commands.log import LogCommand
from quadlab.commands.new import New
from quadlab.commands.processes import Simulator, Station, Vehicle, Web
from quadlab.commands.tracker import Tracker
from quadlab.commands.up import Up
from quadlab.commands.user import User
from quadlab.replay.command import Replay


class Command(Protocol):
    def run(self) -> int:
        """Do it; the exit status. Raises QuadlabError for what the user can mend."""
        ...


COMMANDS: dict[str, type[Command]] = {
    "up": Up,
    "fly": Fly,
    "calibrate": Calibrate,
    "camera": Camera,
    "log": LogCommand,
    "link": LinkCommand,
    "replay": Replay,
    "gains": Gains,
    "new": New,
    "vehicle": Vehicle,
    "simulator": Simulator,
    "station": Station,
    "web": Web,
    "tracker": Tracker,
    "user": User,
}
