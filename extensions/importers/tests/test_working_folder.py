"""Leftovers of imports that were killed."""

import subprocess
import sys
from pathlib import Path

import pytest

from extensions.importers.working_folder import working_folder
from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError

MAKE = """
import sys
from pathlib import Path
from extensions.importers.working_folder import working_folder
with working_folder(Path(sys.argv[1]), ".import-") as folder:
    (folder / "part").write_bytes(bytes(9))
    print(folder, flush=True)
    sys.stdin.read()
"""


def test_the_next_import_removes_what_a_killed_one_left_and_nothing_of_one_that_runs(
    tmp_path: Path,
) -> None:
    words = [sys.executable, "-c", MAKE, str(tmp_path)]
    (tmp_path / ".import-of_an_older_version").mkdir()
    (tmp_path / "runs").mkdir()
    with subprocess.Popen(
        words, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        try:
            assert other.stdout
            left = Path(other.stdout.readline().strip())
            with working_folder(tmp_path, ".import-") as mine:
                assert sorted(tmp_path.iterdir()) == sorted([left, mine, tmp_path / "runs"])
        finally:
            other.kill()
    assert (left / "part").exists()
    with working_folder(tmp_path, ".import-") as mine:
        assert sorted(tmp_path.iterdir()) == sorted([mine, tmp_path / "runs"])
    assert list(tmp_path.iterdir()) == [tmp_path / "runs"]


def test_what_a_link_of_such_a_name_points_at_stays(tmp_path: Path) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / ".import-link").symlink_to(tmp_path / "kept")
    with working_folder(tmp_path, ".import-"):
        assert (tmp_path / "kept").is_dir()


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(StorageError, match=r"cannot write in .*/none: No such file"),
        working_folder(tmp_path / "none", ".import-"),
    ):
        pass
