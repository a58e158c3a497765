"""A database whose file is missing stores nothing, and reports it instead of losing data."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from console.catalogue.catalogue import DATABASE, Catalogue
from console.catalogue.notes import write_notes
from console.parameters.history import ParameterHistory, RecordedChange
from console.parameters.presets import ParameterPresets
from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError
from tests.support.runs import run_entry

REMEDY = "mount its disk or restore it, or restart quadlab to continue with what is there"
CHANGE = RecordedChange("control.k_p", 1.0, 2.0, "ada", 1, 1, "", 1)


class Keepers:
    """All parts that write into the data folder's database."""

    def __init__(self, data: Path) -> None:
        self.catalogue = Catalogue(data)
        self.history = ParameterHistory(self.catalogue.engine, "quad1")
        self.presets = ParameterPresets(self.catalogue.engine, "quad1")
        self.catalogue.add(run_entry("r1"))

    def changes(self) -> list[Callable[[], object]]:
        return [
            lambda: self.catalogue.add(run_entry("r2")),
            lambda: write_notes(self.catalogue, "r1", "windy"),
            lambda: self.history.add([CHANGE]),
            lambda: self.presets.save("mine", {"control.k_p": 2.0}, "ada"),
        ]

    def refuse_with(self, reason: str) -> None:
        assert self.catalogue.problem == reason
        for change in self.changes():
            with pytest.raises(StorageError, match=f"^{re.escape(reason)}$"):
                change()


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


@pytest.fixture
def keepers(data: Path) -> Keepers:
    return Keepers(data)


def test_what_cannot_be_kept_is_refused_when_the_data_folder_was_removed(
    data: Path, keepers: Keepers
) -> None:
    assert keepers.catalogue.problem == ""
    shutil.rmtree(data)
    gone = f"the data folder is gone: {data}; nothing is recorded or saved; {REMEDY}"
    keepers.refuse_with(gone)
    assert not data.exists()


def test_a_data_folder_that_comes_back_is_written_again(data: Path, keepers: Keepers) -> None:
    away = data.with_name("away")
    data.rename(away)
    keepers.refuse_with(f"the data folder is gone: {data}; nothing is recorded or saved; {REMEDY}")
    data.mkdir()  # like the empty folder where a disk is not mounted
    missing = f"{DATABASE} is gone from the data folder {data}; only recordings are saved"
    keepers.refuse_with(f"{missing}; {REMEDY}")
    assert list(data.iterdir()) == []
    data.rmdir()
    away.rename(data)
    for change in keepers.changes():
        change()
    keepers.catalogue.close()
    again = Keepers(data)
    assert [(run.id, run.notes) for run in again.catalogue.runs()] == [("r2", ""), ("r1", "windy")]
    assert [change.new for change in again.history.changes()] == [2.0]
    assert [preset.name for preset in again.presets.all()] == ["mine"]


def test_another_database_under_the_name_is_not_taken_for_the_one_that_was_opened(
    data: Path, keepers: Keepers
) -> None:
    shutil.copy(data / DATABASE, data / "copy")
    (data / "copy").replace(data / DATABASE)
    other = f"{data / DATABASE} is not the file that was opened"
    keepers.refuse_with(f"{other}; only recordings are saved; {REMEDY}")


def test_a_database_that_may_not_be_written_is_told_and_can_be_read(
    data: Path, keepers: Keepers
) -> None:
    keepers.catalogue.close()
    (data / DATABASE).chmod(0o444)
    look = (
        "from pathlib import Path; import sys; from console.catalogue.catalogue import Catalogue; "
        "c = Catalogue(Path(sys.argv[1])); print(c.problem); print([r.id for r in c.runs()])"
    )
    told = subprocess.run(
        [*as_others_may(), sys.executable, "-c", look, str(data)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert told.splitlines() == [
        f"{data / DATABASE} is not writable for this user; only recordings are saved; correct "
        "its permissions or its owner",
        "['r1']",
    ]


def as_others_may() -> list[str]:
    """Return words to put before a command: root then has only the rights of permissions."""
    if os.geteuid():
        return []
    assert shutil.which("setpriv"), "root may write everything; setpriv of util-linux prevents it"
    rights = "-dac_override,-dac_read_search"
    return ["setpriv", "--bounding-set", rights, "--inh-caps", rights]
