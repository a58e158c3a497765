"""The command line, which composes vehicle, station, web and simulator; and the notebook interface.

`quadlab.open` returns a recorded run, `quadlab.fly` flies an experiment in simulated time,
`quadlab.connect` signs in at a running laboratory. Extensions add functions, as `quadlab.batch`.
"""

from quadlab.interrupt import end_at_interrupt, is_program

if is_program():  # before all that takes time to import; `quadlab.__main__.program` ends it
    end_at_interrupt()

import os
from typing import TYPE_CHECKING, Any

from quadlab.two_names import answer_to_both

if TYPE_CHECKING:
    from quadlab.laboratory import connect as connect
    from quadlab.run import fly as fly
    from quadlab.run import open as open

__all__ = ["connect", "fly", "open"]

# Matrices here are small: more threads of numpy's library would only be idle, in every process.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
answer_to_both()


def __getattr__(name: str) -> Any:
    """Load each function at its first use, as the command line needs none of them."""
    if name == "connect":
        from quadlab.laboratory import connect

        return connect
    if name in ("open", "fly"):
        from quadlab import run

        return getattr(run, name)
    if not name.startswith("_"):
        from quadrotor.extension import Function
        from quadrotor.extensions import registry

        if (offered := registry().offers(Function, taken=__all__).get(name)) is not None:
            return offered.load()
    raise AttributeError(f"module 'quadlab' has no attribute {name!r}")
