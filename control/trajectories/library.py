"""The trajectories of a folder, loaded before the flight, one per file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from control.trajectories.csv_file import load_csv
from control.trajectories.feasibility import examine
from control.trajectories.limits import Limits
from control.trajectories.polynomial import Polynomial
from control.trajectories.python_file import load_python
from quadrotor.errors import QuadlabError, RefusedError, os_errors
from quadrotor.vehicle_model import VehicleModel

LOADERS = {".csv": load_csv, ".py": load_python}


def load_trajectory(path: Path) -> Polynomial:
    """Load the trajectory of a .csv or .py file, and find when it demands most of the vehicle.

    Finding those times takes a dense sampling of the whole path, which a start in flight could not
    afford. Raises RefusedError or StorageError.
    """
    loader = LOADERS.get(path.suffix.lower())
    if loader is None:
        raise RefusedError(
            f"{path.name}: {path.suffix or 'no ending'} is not a kind of trajectory file; "
            f"there are {', '.join(LOADERS)}"
        )
    found = loader(path)
    report = examine(found, VehicleModel().record(), Limits())
    times = tuple(sorted({extreme.time for extreme in report.extremes}))
    return Polynomial(found.times, found.coefficients, times)


GROUP = "quadlab.trajectories"
"""Group of entry points by which installed packages offer modules with a trajectory."""


def files_of(folder: Path) -> list[tuple[str, Path]]:
    """Return name (without ending) and path of the .csv and .py files whose names start with a
    letter or digit; subfolders are not searched. Raises StorageError.
    """
    with os_errors(lambda why: f"the trajectory folder {folder} cannot be read: {why}"):
        files = sorted(p for p in folder.iterdir() if p.suffix.lower() in LOADERS)
    return [(path.stem, path) for path in files if path.stem[:1].isalnum()]


def load_files(files: Iterable[tuple[str, Path]]) -> tuple[dict[str, Polynomial], list[str]]:
    """Return name -> trajectory, and one line for each refused file.

    Never called in flight, as it runs Python files, which may take any time.
    """
    loaded: dict[str, Polynomial] = {}
    refused: list[str] = []
    for name, path in files:
        try:
            if name in loaded:
                raise RefusedError(f"{path.name}: there is another file called {name}")
            loaded[name] = load_trajectory(path)
        except QuadlabError as error:
            refused.append(str(error))
    return loaded, refused
