"""`quadlab link observer NAME` and `quadlab link pilot NAME`: certificates for further stations."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from quadlab.commands.option_types import Folder, optional
from quadlab.data_folder import open_data_folder
from quadlab.link_commands.certificate_bundle import REMOTE_FOLDER, write_bundle
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from vehicle_link.security.access import Access

MAY = {
    "observer": "receives and reads everything, and can command nothing",
    "pilot": "may do everything that this base may",
}


@dataclass
class _Station:
    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """of the person or machine, like ben"""
    out: Annotated[Path | None, optional("DIR")] = None
    """folder, or file ending in .tar, for what the station needs"""
    data: Folder = None
    """data folder"""

    def issue(self, access: Access) -> int:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,31}", self.name):
            raise UsageError(
                f"{self.name!r} is no name for a station; allowed are up to 32 letters, digits and "
                ". _ -, a letter or digit first, like ben"
            )
        from vehicle_link.security.enrolment import issue_station

        data = open_data_folder(self.data)
        out = self.out or data / "issued" / f"{access}_{self.name}"
        base = data / "certificates"
        made = write_bundle(out, partial(issue_station, base, name=self.name, access=access))
        print(f"{self.name}'s station {MAY[access]}; its files are in {made}")
        print(
            f"1. copy ca.pem, station.pem and station.key into {REMOTE_FOLDER} there (mode 0700), "
            "or into\n   the folder certificates of another data folder"
        )
        print("2. there: quadlab station --vehicle NAME=ADDRESS")
        print(f"station.key is a secret: delete {made} once it is copied")
        return 0


@dataclass
class Observer(_Station):
    """Issue files for a station that may watch, but not command."""

    def run(self) -> int:
        return self.issue("observer")


@dataclass
class Pilot(_Station):
    """Issue files for a further station that may do everything."""

    def run(self) -> int:
        return self.issue("pilot")
