"""The commands by name; each is a dataclass of options with `run() -> int`."""

from __future__ import annotations

import textwrap
from typing import Protocol

from quadlab.commands.calibrate import Calibrate
from quadlab.commands.camera import Camera
from quadlab.commands.doctor import Doctor
from quadlab.commands.export import Export
from quadlab.commands.fly import Fly
from quadlab.commands.gains import Gains
from quadlab.commands.link import LinkCommand
from quadlab.commands.log import LogCommand
from quadlab.commands.mavlink import Mavlink
from quadlab.commands.new import New
from quadlab.commands.processes import Simulator, Station, Vehicle, Web
from quadlab.commands.tracker import Tracker
from quadlab.commands.up import Up
from quadlab.commands.user import User
from quadlab.replay.command import Replay


class Command(Protocol):
    def run(self) -> int:
        """Run the command; return the exit status. Raises QuadlabError for correctable errors."""
        ...


GROUPS: dict[str, dict[str, type[Command]]] = {
    "Fly": {"up": Up, "fly": Fly, "calibrate": Calibrate},
    "Recorded flights": {"log": LogCommand, "replay": Replay},
    "Set up": {
        "link": LinkCommand,
        "user": User,
        "camera": Camera,
        "gains": Gains,
        "new": New,
        "export": Export,
        "doctor": Doctor,
    },
    "Run one process (quadlab up starts what it needs)": {
        "vehicle": Vehicle,
        "simulator": Simulator,
        "station": Station,
        "tracker": Tracker,
        "web": Web,
        "mavlink": Mavlink,
    },
}
COMMANDS: dict[str, type[Command]] = {
    name: command for group in GROUPS.values() for name, command in group.items()
}
OVERVIEW = """usage: quadlab COMMAND [OPTIONS]

Base station and experiment console of a quadrotor laboratory.
{commands}
Examples:
  quadlab up                              fly a simulated vehicle under the page
  quadlab fly figure_eight --report       fly the paper's 8 in simulated time
  quadlab log report LOG                  make a report of a recorded flight

quadlab COMMAND --help lists the options of a command, with examples. quadlab completion SHELL
prints the completion for bash, zsh or tcsh, and quadlab --version the version.
"""


def overview() -> str:
    """Return the output of `quadlab` alone: the commands by group, with one sentence each."""
    lines = []
    for group, commands in GROUPS.items():
        lines += ["", f"{group}:"]
        for name, command in commands.items():
            words = " ".join((command.__doc__ or "").split("\n\n")[0].split())
            lines.append(
                textwrap.fill(words, 100, initial_indent=f"  {name:12}", subsequent_indent=" " * 14)
            )
    return OVERVIEW.format(commands="\n".join([*lines, ""]))
