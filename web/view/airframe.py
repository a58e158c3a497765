"""Drawing of the vehicle: a plus frame with four rotors, the front arm marked.

All nodes are children of one frame (`/vehicle`), so that one pose moves everything. Lengths in m.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from web.view.shapes import Point

if TYPE_CHECKING:
    from viser import MeshHandle, SceneApi

    from web.view.shapes import Point, Quaternion

ROTORS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""Directions of the front, left, rear and right rotors, body axes (x forward, y left)."""

Mesh = tuple[npt.NDArray[Any], npt.NDArray[Any]]
"""Vertices, shape (n, 3), and faces, shape (m, 3), counter-clockwise from outside."""

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
        scene: SceneApi,
        name: str,
        *,
        arm: float = 0.25,
        ghost: bool = False,
        tint: tuple[int, int, int] = (150, 190, 220),
        opacity: float = 0.25,
    ) -> None:
        self.frame = scene.add_frame(name, show_axes=False, visible=False)
        self._propellers: list[MeshHandle] = []
        self._angles = [0.0] * 4
        frame = [_box((0.13, 0.13, 0.045)), *(_motor(arm * x, arm * y) for x, y in ROTORS)]
        front, *others = (_arm(arm, x, y) for x, y in ROTORS)
        if ghost:
            look = {"opacity": opacity, "cast_shadow": False, "receive_shadow": False}
            _add(scene, f"{name}/body", [*frame, front, *others], tint, **look)
            return
        _add(scene, f"{name}/body", [*frame, *others], _DARK, receive_shadow=False)
        _add(scene, f"{name}/front", [front], _FRONT, receive_shadow=False)
        board = _box((0.075, 0.075, 0.018), (0.0, 0.0, 0.03))
        _add(scene, f"{name}/board", [board], _LIGHT, receive_shadow=False)
        scene.add_frame(
            f"{name}/axes",
            axes_length=0.18,
            axes_radius=0.005,
            origin_radius=0.0,
            position=(0.0, 0.0, 0.035),
        )
        discs = [_cylinder(_ROTOR_RADIUS, 0.001, (arm * x, arm * y, 0.055), 32) for x, y in ROTORS]
        look = {"opacity": 0.1, "cast_shadow": False, "receive_shadow": False}
        _add(scene, f"{name}/front_disc", discs[:1], _FRONT, **look)
        _add(scene, f"{name}/discs", discs[1:], _LIGHT, **look)
        for index, (x, y) in enumerate(ROTORS):
            self._propellers.append(
                scene.add_mesh_simple(
                    f"{name}/rotor_{index}",
                    *_blades(_ROTOR_RADIUS, clockwise=index % 2 == 0),
                    color=_BLADE,
                    side="double",
                    position=(arm * x, arm * y, 0.055),
                )
            )

    def pose(self, position: Point, quaternion: Quaternion) -> None:
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


def _add(
    scene: SceneApi, name: str, solids: list[Mesh], color: tuple[int, int, int], **look: Any
) -> None:
    """Add solids of one colour as one mesh: the browser's time goes by meshes, not by faces."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in solids)])
    vertices = np.concatenate([vertices for vertices, _ in solids]).astype(np.float32)
    faces = [faces + start for (_, faces), start in zip(solids, starts, strict=False)]
    merged = np.concatenate(faces).astype(np.uint32)
    scene.add_mesh_simple(name, vertices, merged, color=color, flat_shading=True, **look)


def _arm(arm: float, x: float, y: float) -> Mesh:
    size = (arm, 0.018, 0.014) if x else (0.018, arm, 0.014)
    return _box(size, (0.5 * arm * x, 0.5 * arm * y, 0.0))


def _motor(x: float, y: float) -> Mesh:
    return _cylinder(0.017, 0.045, (x, y, 0.026), 12)


def _box(size: Point, centre: Point = (0.0, 0.0, 0.0)) -> Mesh:
    outline = 0.5 * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * size[:2]
    return _prism(outline, size[2], centre)


def _cylinder(radius: float, height: float, centre: Point, sides: int) -> Mesh:
    angles = np.arange(sides) * math.tau / sides
    return _prism(radius * np.stack((np.cos(angles), np.sin(angles)), axis=1), height, centre)


def _prism(outline: npt.NDArray[np.float64], height: float, centre: Point) -> Mesh:
    """Return an upright prism over a convex outline, shape (n, 2), counter-clockwise from above."""
    n = len(outline)
    ends = [np.column_stack((outline, np.full(n, end * height))) for end in (-0.5, 0.5)]
    i = np.arange(n)
    j = (i + 1) % n
    fan = np.stack((np.zeros(n - 2, int), i[1:-1], i[2:]), axis=1)
    walls = [np.stack((i, j, j + n), axis=1), np.stack((i, j + n, i + n), axis=1)]
    return np.concatenate(ends) + centre, np.concatenate([*walls, fan[:, ::-1], fan + n])


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
