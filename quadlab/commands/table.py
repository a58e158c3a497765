"""The commands by name; each is a dataclass of options with `run() -> int`."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from functools import lru_cache, reduce
from importlib.util import find_spec
from operator import or_
from typing import Annotated, Protocol

from quadrotor.checkout import IS_VEHICLE_S
from quadrotor.extension import Command as Row
from quadrotor.extension import Group
from quadrotor.extensions import Offered, registry


class Command(Protocol):
    def run(self) -> int:
        """Run the command; return the exit status. Raises QuadlabError for correctable errors."""
        ...


_ROWS = (
    Row(
        name="up",
        group=Group.FLY,
        summary="Start a simulated vehicle, the station and the page, and print a sign-in link.",
        target=".up:Up",
        examples={
            "quadlab up": "fly a simulated vehicle under the page",
            "quadlab up --set simulator.preset=rough": "… as rough as a real one",
            "quadlab up --tracker natnet": "… on the poses of a simulated OptiTrack",
        },
    ),
    Row(
        name="fly",
        group=Group.FLY,
        summary="Fly an experiment on the simulated vehicle, as fast as the processor goes.",
        target=".fly:Fly",
        examples={
            "quadlab fly figure_eight --report": "fly the paper's 8, and make a report of it",
            "quadlab fly bearings --seed 3 --out flights": "fly on bearings, log into flights/",
            "quadlab fly hover --set control.preset=stiff": "fly with other gains",
            'quadlab fly hover --set faults="motors.fade from=12 ramp=3"': (
                "with a motor that fades"
            ),
        },
    ),
    Row(
        name="calibrate",
        group=Group.FLY,
        summary="Calibrate the vehicle of the running station; without a name, print the "
        "calibrations in force.",
        target=".calibrate:Calibrate",
        examples={
            "quadlab calibrate": "print the calibrations in force",
            "quadlab calibrate accelerometer": "calibrate, guided step by step",
            "quadlab calibrate gyroscope --accept": "calibrate in a script",
        },
    ),
    Row(
        name="log",
        group=Group.RECORDED,
        summary="Inspect, check, repair, fetch, import or export logs, and write reports.",
        target=".log:LogCommand",
        examples={"quadlab log info --explain LOG": "print what happened in a flight"},
    ),
    Row(
        name="link",
        group=Group.SET_UP,
        summary="Enrol vehicles and further stations, list vehicles, test a link.",
        target=".link:LinkCommand",
        examples={
            "quadlab link enrol quad1 192.168.1.20": "create the certificates of a vehicle",
            "quadlab link list --seek": "list known vehicles, and others on this network",
        },
    ),
    Row(
        name="user",
        group=Group.SET_UP,
        summary="Manage the accounts for the page: add, list, remove, role NAME ROLE, password.",
        target=".user:User",
        examples={
            "quadlab user add anna": "add an account; asks for the password",
            "quadlab user role anna operator": "change what an account may do",
        },
    ),
    Row(
        name="gains",
        group=Group.SET_UP,
        summary="Print the phase margins of the named gain sets, and of one made with --set.",
        target=".gains:Gains",
        examples={
            "quadlab gains": "print the margins of the named gain sets",
            "quadlab gains --set control.position.kp_xy=5": "… and of one that differs",
        },
    ),
    Row(
        name="new",
        group=Group.SET_UP,
        summary="Write a control law, an estimator, a behavior, a sensor, an experiment, a "
        "trajectory or an extension to start from; it runs as it is.",
        target=".new:New",
        examples={
            "quadlab new law mine": "write a control law and its test into the data folder",
            "quadlab new estimator mine": "write an estimator and its test",
            "quadlab new behavior mine": "write a behavior and its test",
            "quadlab new extension mine": "write a package that adds a tracking system",
        },
    ),
    Row(
        name="doctor",
        group=Group.SET_UP,
        summary="Print versions, computer and checks of this machine, for a report of a problem.",
        target=".doctor:Doctor",
        examples={"quadlab doctor": "print what a maintainer asks for"},
    ),
    Row(
        name="vehicle",
        group=Group.PROCESS,
        summary="Run the vehicle's flight stack on board: flight and comms process.",
        target=".vehicle:Vehicle",
        examples={
            "quadlab vehicle --find": "list the serial devices, and what answers there",
            "quadlab vehicle --check --serial auto": "check the board without propellers",
            "quadlab vehicle --serial auto --rate 500": "fly",
            "quadlab vehicle --board betaflight --serial /dev/ttyACM0 --check": (
                "check its settings"
            ),
            "quadlab vehicle --board crazyflie --serial radio://0/80/2M/E7E7E7E7E7 --check": (
                "the same"
            ),
        },
    ),
    Row(
        name="simulator",
        group=Group.PROCESS,
        summary="Run the simulated plant and microcontroller behind two pseudo-terminals.",
        target=".processes:Simulator",
        examples={"quadlab simulator --folder quad": "simulate a vehicle behind quad/mcu0"},
    ),
    Row(
        name="station",
        group=Group.PROCESS,
        summary="Run the base station: tracker, recorder, run catalogue, forwarding of commands.",
        target=".processes:Station",
        examples={"quadlab station --vehicle quad1": "run the station of one vehicle"},
    ),
    Row(
        name="tracker",
        group=Group.PROCESS,
        summary="Connect a laboratory's tracking system to the station.",
        target=".tracker:Tracker",
        examples={
            "quadlab tracker natnet --host 192.168.1.5 --body quad1=cf7": "track with OptiTrack"
        },
    ),
    Row(
        name="web",
        group=Group.PROCESS,
        summary="Serve the page.",
        target=".processes:Web",
        examples={"quadlab web --port 8080": "serve the page of a running station"},
    ),
)
"""The commands of quadlab itself; the target of each is relative to this package."""
OVERVIEW = """usage: quadlab COMMAND [OPTIONS]

Base station and experiment console of a quadrotor laboratory.
{commands}
Examples:
{examples}

quadlab COMMAND --help lists the options of a command, with examples. quadlab completion SHELL
prints the completion for bash, zsh or tcsh, and quadlab --version the version.
"""

EXAMPLES = (
    """\
  quadlab vehicle --check --serial auto   check the board without propellers
  quadlab vehicle --serial auto           fly"""
    if IS_VEHICLE_S
    else """\
  quadlab up                              fly a simulated vehicle under the page
  quadlab fly figure_eight                fly the paper's 8 in simulated time
  quadlab log info --explain LOG          print what happened in a recorded flight"""
)


@lru_cache(maxsize=1)
def commands() -> Mapping[str, Offered[Row]]:
    """Return all commands by name, in the order of their groups."""
    own = {row.name: Offered(row, __package__) for row in _ROWS if _is_installed(row)}
    if IS_VEHICLE_S:
        return own
    found = own | {n: c for n, c in registry().offers(Row, own).items() if c.offer.group}
    order = list(Group)
    return dict(sorted(found.items(), key=lambda item: order.index(_group(item[1]))))


def _is_installed(row: Row) -> bool:
    return not IS_VEHICLE_S or find_spec(row.target.partition(":")[0], __package__) is not None


def is_at_station(name: str) -> bool:
    """Return whether a command is missing because this copy is the vehicle's part alone."""
    return IS_VEHICLE_S and any(row.name == name for row in _ROWS)


def _group(offered: Offered[Row]) -> Group:
    assert offered.offer.group is not None
    return offered.offer.group


def actions(command: str) -> dict[str, type[Command]]:
    """Return the actions that extensions add to a command, by the second word of their names."""
    found = registry().offers(Row)
    words = {name.partition(" ")[2]: one for name, one in found.items() if _is_of(name, command)}
    return {word: one.load() for word, one in words.items()}


def of_several() -> set[str]:
    """Return the commands that need an action as their second word."""
    return {"log", "link"} | {n.partition(" ")[0] for n in registry().offers(Row) if " " in n}


def chosen(actions: Mapping[str, type[Command]]) -> object:
    """Return the type of an option whose first word chooses one of these actions."""
    import tyro

    return reduce(
        or_, (Annotated[one, tyro.conf.subcommand(word)] for word, one in actions.items())
    )


def _is_of(name: str, command: str) -> bool:
    return name.partition(" ")[0] == command and " " in name


def overview() -> str:
    """Return the output of `quadlab` alone: the commands by group, with one sentence each."""
    return OVERVIEW.format(commands="\n".join([*_listed(), ""]), examples=EXAMPLES)


def _listed() -> Iterator[str]:
    group = None
    for name, offered in commands().items():
        row = offered.offer
        if row.group is not group:
            group = row.group
            yield from ("", f"{group}:")
        yield textwrap.fill(
            row.summary, 100, initial_indent=f"  {name:12}", subsequent_indent=" " * 14
        )


def examples_of(command: str) -> str:
    """Return the examples that `quadlab COMMAND --help` prints below the options."""
    rows = [one.offer for name, one in commands().items() if name == command]
    rows += [one.offer for name, one in registry().offers(Row).items() if _is_of(name, command)]
    shown = {words: what for row in rows for words, what in row.examples.items()}
    width = max(map(len, shown), default=0)
    lines = [f"  {words:{width}}  {what}" for words, what in shown.items()]
    return "\n".join(["Examples:", *lines, ""]) if lines else ""
