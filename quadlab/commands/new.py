"""`quadlab new KIND NAME`: writes a file to start from, and its test."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Folder
from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError, UsageError
from quadrotor.extensions import registry


class Kind(NamedTuple):
    """A kind of file that can be written: a copy of an example, and of its test if it has one.

    Attributes:
        template: file in examples, without its suffix. folder: folder in the data folder.
        fly: command that flies it, with {name}, {path} and {plugins}.
        taken: returns the names of the built-in ones.
    """

    template: str
    folder: str
    fly: str
    taken: Callable[[], Collection[str]]


def _laws() -> Collection[str]:
    from vehicle.laws.laws import Laws

    return Laws().names()


def _estimators() -> Collection[str]:
    from estimation import registry
    from vehicle.plugins.links import UDP

    return *registry.names(), "none", UDP


def _behaviors() -> Collection[str]:
    from control.behaviors.table import BehaviorName

    return "none", *(name.lower() for name in BehaviorName.__members__)


def _experiments() -> Collection[str]:
    from console.experiments.catalogue import experiments

    return experiments().keys()


KINDS = {
    "law": Kind(
        "laws/geometric_pid",
        "plugins",
        "quadlab fly hover --set control.law={name}{plugins}",
        _laws,
    ),
    "estimator": Kind(
        "estimators/error_state_ekf",
        "plugins",
        "quadlab fly figure_eight --set estimation.estimator={name}{plugins}",
        _estimators,
    ),
    "behavior": Kind(
        "behaviors/sway",
        "plugins",
        "quadlab fly own_behavior --set behavior.plugin={name}{plugins}",
        _behaviors,
    ),
    "sensor": Kind(
        "sensors/barometer",
        "plugins",
        "quadlab fly figure_eight --set estimation.estimator=error_state "
        "estimation.sensors={name}{plugins}",
        lambda: ("none",),
    ),
    "experiment": Kind("experiments/side_step", "experiments", "quadlab fly {path}", _experiments),
    "trajectory": Kind(
        "trajectories/spiral",
        "trajectories",
        "quadlab up, then follow_trajectory with trajectory = file, file = {name}",
        tuple,
    ),
}


EXTENSION, EXAMPLE = "extension", "starlight"


@dataclass
class New:
    """Write a control law, an estimator, a behavior, a sensor, an experiment, a trajectory or an
    extension to start from; it runs as it is."""

    kind: Annotated[
        Literal["law", "estimator", "behavior", "sensor", "experiment", "trajectory", "extension"],
        tyro.conf.Positional,
    ]
    """what to write: law, estimator, behavior, sensor (docs/extending/plugins.md; a test comes with
    it), experiment (docs/experiments.md), trajectory (docs/trajectories.md), extension, which is a
    package (docs/extending/extensions.md)"""
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """its name, by which it is chosen, as --set control.law=NAME: letters, digits and _"""
    out: Folder = None
    """folder to write to (default: the one of the data folder where it is found)"""

    def run(self) -> int:
        from vehicle.plugins.plugins import TESTS

        if not self.name.isidentifier() or self.name.startswith(("_", TESTS)):
            raise UsageError(
                f"NAME {self.name!r}: use letters, digits and _, and begin with a letter but not "
                f"with {TESTS}"
            )
        if self.kind == EXTENSION:
            return self._write_extension()
        kind = KINDS[self.kind]
        if self.name in kind.taken():
            raise UsageError(f"NAME {self.name!r} is a built-in {self.kind}; choose another")
        folder = self.out or open_data_folder(None) / kind.folder
        template = ROOT / "examples" / f"{kind.template}.py"
        path, test = folder / f"{self.name}.py", folder / f"{TESTS}{self.name}.py"
        tested = template.with_name(f"{TESTS}{template.name}")
        for source, target in ((template, path), (tested, test)):
            if source.exists():
                _write(target, source.read_text().replace(template.stem, self.name))
                print(target)
        plugins = f" --plugins {folder}" if self.out else ""
        print(f"fly it:  {kind.fly.format(name=self.name, path=path, plugins=plugins)}")
        if tested.exists():
            print(f"test it: python -m pytest {test}")
        return 0

    def _write_extension(self) -> int:
        """Write a package with the example's tracking system and tab, under another name."""
        if importlib.util.find_spec(self.name) is not None or self.name in _extensions():
            raise UsageError(
                f"NAME {self.name!r} is that of a module or an extension that is there; choose "
                "another"
            )
        folder = (self.out or Path.cwd()) / self.name
        if folder.exists():
            raise StorageError(f"{folder} exists already; choose another name or folder")
        example = ROOT / "examples" / "extensions" / EXAMPLE
        for source in sorted(example.rglob("*.*")):
            if source.is_file() and source.suffix in (".py", ".toml", ".js", ".css"):
                place = str(source.relative_to(example)).replace(EXAMPLE, self.name)
                text = source.read_text().replace(EXAMPLE, self.name)
                _write(folder / place, text.replace(EXAMPLE.title(), self.name.title()))
                print(folder / place)
        print(f"install it: python -m pip install -e {folder}")
        print(f"use it:     quadlab tracker {self.name}")
        print(f"test it:    python -m pytest {folder}")
        return 0


def _extensions() -> Collection[str]:
    return [one.name for one in registry().extensions]


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x") as file:
            file.write(text)
    except FileExistsError:
        raise StorageError(f"{path} exists already; choose another name or folder") from None
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {error.strerror}") from None
