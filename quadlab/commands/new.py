"""`quadlab new KIND NAME`: a file of one's own to start from, and its test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadlab.commands.option_types import Folder
from quadlab.data_folder import open_data_folder
from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError, UsageError

TEMPLATES = ROOT / "examples" / "laws"
TEMPLATE = "geometric_pid"
"""The example that a new law is a copy of."""


@dataclass
class New:
    """Write a control law to start from, and a test for it; both run as they are."""

    kind: Annotated[Literal["law"], tyro.conf.Positional]
    """what to write: law (docs/extending/plugins.md)"""
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """its name, chosen by --set control.law=NAME: letters, digits and _"""
    out: Folder = None
    """folder to write to (default: plugins in the data folder, where the vehicle finds it)"""

    def run(self) -> int:
        from vehicle.laws.laws import BUILT_IN, UDP
        from vehicle.plugins.plugins import TESTS
        from vehicle.processes.parent import PLUGINS

        if not self.name.isidentifier() or self.name.startswith(("_", TESTS)):
            raise UsageError(
                f"NAME {self.name!r}: use letters, digits and _, and begin with a letter but not "
                f"with {TESTS}"
            )
        if self.name in (*BUILT_IN, UDP):
            raise UsageError(f"NAME {self.name!r} is a built-in law; choose another")
        folder = self.out or open_data_folder(None) / PLUGINS
        for template in (f"{TEMPLATE}.py", f"{TESTS}{TEMPLATE}.py"):
            path = folder / template.replace(TEMPLATE, self.name)
            _write(path, (TEMPLATES / template).read_text().replace(TEMPLATE, self.name))
            print(path)
        print(f"fly it:  quadlab fly hover --set control.law={self.name}", end="")
        print(f" --plugins {folder}" if self.out else "")
        print(f"test it: python -m pytest {folder / (TESTS + self.name + '.py')}")
        return 0


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x") as file:
            file.write(text)
    except FileExistsError:
        raise StorageError(f"{path} exists already; choose another name or folder") from None
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {error.strerror}") from None
