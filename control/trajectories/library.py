"""The trajectories of a folder, loaded before the flight, one per file."""

from __future__ import annotations

from pathlib import Path

from control.trajectories.csv_file import load_csv
from control.trajectories.feasibility import examine
from control.trajectories.limits import Limits
from control.trajectories.polynomial import Polynomial
from control.trajectories.python_file import load_python
from quadrotor.errors import QuadlabError, RefusedError, StorageError
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
            f"{path.name}: {path.suffix or 'no ending'} is no kind of trajectory file; there are "
            f"{', '.join(LOADERS)}"
        )
    found = loader(path)
    report = examine(found, VehicleModel().record(), Limits())
    times = tuple(sorted({extreme.time for extreme in report.extremes}))
    return Polynomial(found.times, found.coefficients, times)


def load_folder(folder: Path) -> tuple[dict[str, Polynomial], list[str]]:
    """Return name (the file's, without ending) -> trajectory, and one line for each refused file.

    Loads .csv and .py files whose name starts with a letter or digit, but not those of subfolders.
    Never called in flight, as it runs Python files, which may take any time. Raises StorageError
    when the folder cannot be read.
    """
    try:
        files = sorted(p for p in folder.iterdir() if p.suffix.lower() in LOADERS)
    except OSError as error:
        raise StorageError(
            f"the trajectory folder {folder} cannot be read: {error.strerror}"
        ) from None
    loaded: dict[str, Polynomial] = {}
    refused: list[str] = []
    for path in files:
        if not path.stem[:1].isalnum():
            continue
        try:
            if path.stem in loaded:
                raise RefusedError(f"{path.name}: there is another file called {path.stem}")
            loaded[path.stem] = load_trajectory(path)
        except QuadlabError as error:
            refused.append(str(error))
    return loaded, refused
