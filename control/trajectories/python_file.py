"""A trajectory from a Python file that defines `trajectory`.

`trajectory` is an object of the `Trajectory` protocol, or a class or function that creates one when
called without arguments. It is run once, when it is loaded: the vehicle flies the table made from
it.
"""

from __future__ import annotations

from pathlib import Path

from control.trajectories.polynomial import Polynomial
from control.trajectories.tabulated import tabulate
from quadrotor.errors import RefusedError
from quadrotor.python_file import call_user_code, run_file

NAME = "trajectory"


def load_python(path: Path) -> Polynomial:
    """Load the trajectory in the file `path`, which is run with all the rights of this process.

    Raises RefusedError that names the line, StorageError for a file that cannot be read.
    """
    space = vars(run_file(path, "trajectory", RefusedError))
    if NAME not in space:
        raise RefusedError(
            f"{path.name}: it defines no {NAME!r}; give a class, function or object of this name "
            "that offers duration (s) and sample(t, reference)"
        )
    made = space[NAME]
    # A class has `sample` too, but not one that can be called yet.
    if isinstance(made, type) or not hasattr(made, "sample"):
        if not callable(made):
            raise RefusedError(
                f"{path.name}: {NAME} is {type(made).__name__}, which has no sample(t, reference)"
            )
        made = call_user_code(path, made, RefusedError)
    for wanted in ("duration", "sample"):
        if not hasattr(made, wanted):
            raise RefusedError(
                f"{path.name}: what {NAME} makes ({type(made).__name__}) has no {wanted}; it needs "
                "duration (s) and sample(t, reference)"
            )
    return call_user_code(path, lambda: tabulate(path.name, made), RefusedError)
