"""Drawing of the vehicle: a plus frame with four rotors, the front arm marked.

All nodes are children of one frame (`/vehicle`), so that one pose moves everything. Lengths in m.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

ROTORS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""Directions of the front, left, rear and right rotors, body axes (x forward, y left)."""

_ROTOR_RADIUS = 0.125
_DARK = (92, 103, 114)
_LIGHT = (206, 213, 220)
_FRONT = (255, 146, 43)
_BLADE = (222, 228, 234)


class Airframe:
    """Drawn vehicle; `pose` moves it, `spin` turns its propellers.

    Args:
        arm: distance from the centre to a rotor axis, m.
        ghost: draw a pale outline without propellers, for another pose than the estimate.
        tint, opacity: those of a ghost, sRGB.
    """

    def __init__(
        self,
        scene: Any,
        name: str,
        *,
        arm: float = 0.25,
        ghost: bool = False,
        tint: tuple[int, int, int] = (150, 190, 220),
        opacity: float = 0.25,
    ) -> None:
        self.frame = scene.add_frame(name, show_axes=False, visible=False)
        self._propellers: list[Any] = []
        self._angles = [0.0] * 4
        _add_body(scene, name, arm, tint if ghost else _DARK, opacity if ghost else None)
        if ghost:
            return
        scene.add_frame(
            f"{name}/axes",
            axes_length=0.18,
            axes_radius=0.005,
            origin_radius=0.0,
            position=(0.0, 0.0, 0.035),
        )
        for index, (x, y) in enumerate(ROTORS):
            rotor = f"{name}/rotor_{index}"
            self._propellers.append(
                scene.add_mesh_simple(
                    rotor,
                    *_blades(_ROTOR_RADIUS, clockwise=index % 2 == 0),
                    color=_BLADE,
                    side="double",
                    position=(arm * x, arm * y, 0.055),
                )
            )
            scene.add_cylinder(
                f"{name}/disc_{index}",
                radius=_ROTOR_RADIUS,
                height=0.001,
                color=_FRONT if index == 0 else _LIGHT,
                opacity=0.1,
                cast_shadow=False,
                receive_shadow=False,
                position=(arm * x, arm * y, 0.055),
            )

    def pose(self, position: Any, quaternion: Any) -> None:
        """Set position (m) and quaternion (w, x, y, z), body to world."""
        self.frame.position = position
        self.frame.wxyz = quaternion

    def spin(self, turns: list[float]) -> None:
        """Turn each propeller by a share of a revolution, in the order of ROTORS."""
        for index, (node, turn) in enumerate(zip(self._propellers, turns, strict=True)):
            if turn == 0.0:
                continue
            sense = -1.0 if index % 2 == 0 else 1.0  # front and rear turn clockwise from above
            angle = self._angles[index] = (self._angles[index] + sense * turn * math.tau) % math.tau
            node.wxyz = (math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))


def _add_body(
    scene: Any, name: str, arm: float, color: tuple[int, int, int], opacity: float | None
) -> None:
    """Add the body; `opacity` is that of a ghost, or None."""
    ghost = opacity is not None
    look: dict[str, Any] = {"cast_shadow": not ghost, "receive_shadow": False}
    if ghost:
        look |= {"opacity": opacity}
    scene.add_box(f"{name}/hub", color=color, dimensions=(0.13, 0.13, 0.045), **look)
    if not ghost:
        scene.add_box(
            f"{name}/board",
            color=_LIGHT,
            dimensions=(0.075, 0.075, 0.018),
            position=(0.0, 0.0, 0.03),
            **look,
        )
    for index, (x, y) in enumerate(ROTORS):
        is_front = index == 0 and not ghost
        scene.add_box(
            f"{name}/arm_{index}",
            color=_FRONT if is_front else color,
            dimensions=(arm, 0.018, 0.014) if x else (0.018, arm, 0.014),
            position=(0.5 * arm * x, 0.5 * arm * y, 0.0),
            **look,
        )
        scene.add_cylinder(
            f"{name}/motor_{index}",
            radius=0.017,
            height=0.045,
            color=color,
            position=(arm * x, arm * y, 0.026),
            **look,
        )


def _blades(
    radius: float, *, clockwise: bool
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
    """Return two twisted blades, vertices (8, 3) and faces (4, 3)."""
    pitch = -0.012 if clockwise else 0.012
    vertices: list[tuple[float, float, float]] = []
    faces: list[tuple[int, int, int]] = []
    for side in (1.0, -1.0):
        base = len(vertices)
        for span, chord in ((0.1, 0.010), (1.0, 0.007)):
            vertices.append((side * span * radius, chord, side * pitch * (1.2 - span)))
            vertices.append((side * span * radius, -chord, -side * pitch * (1.2 - span)))
        faces += [(base, base + 1, base + 2), (base + 1, base + 3, base + 2)]
    return np.array(vertices, np.float32), np.array(faces, np.uint32)
