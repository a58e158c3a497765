"""The common part of calibrations that fly by themselves: asked first, and brought down at the
end.
"""

from __future__ import annotations

import numpy as np

from console.experiments.client import Client, VehicleView

CLEAR = (
    "The motors start and the vehicle takes off on its own. Is everybody clear of it, with 2 m of "
    "room on each side?"
)
LANDING = 30.0
"""s."""


def missing_place(view: VehicleView) -> str:
    """Return why it may not begin, as text; empty when it may."""
    if not np.isfinite(view.position_w).all():
        return "the vehicle does not know where it is; check the tracker"
    return ""


def come_down(client: Client) -> None:
    """Land if in flight, and wait until the motors are off. Raises RefusedError."""
    view = client.view()
    if view.mode == "armed" and view.behavior not in ("ground", "land"):
        client.start("land")
    if view.armed and view.behavior != "ground":
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=LANDING)
    client.wait(0.5)
