"""Drafts in the 3D view: a target, way-points, a trajectory's start, a flight volume or a keep-out
box that an operator moves by its handles before anything is commanded.

A disc moves a point in its level plane, the pair of cones along one axis. Nodes are created when
first needed and hidden when not, because viser keeps a tombstone of every removed node.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from quadrotor.parameter_description import ParameterValue
from web.view.beacons.marks import Mark, only_offered
from web.view.drag import FARTHEST, Click, Drag
from web.view.lines import PLANNED, REFUSED, edges, line_color
from web.view.server import ViewServer
from web.view.shapes import Point, along_axis, cones, distance_to_ray, on_plane, turns_from_z

if TYPE_CHECKING:
    from viser import LineSegmentsHandle, MeshHandle, SceneClickEvent

Kind = Literal["target", "waypoints", "trajectory", "volume", "keep_out"]
MOST = 12  # way-points, as the vehicle's behavior takes them
LEVEL = 2  # axis
THINNEST = 0.1  # m between two faces of a box
NEAR = 0.3  # m; a click this close to a handle is meant for it
GROUND: Point = (0.0, 0.0, 0.0)
UP: Point = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Draft:
    """A command that an operator prepares.

    Attributes:
        points: m, world. Of a volume or box the lowest and the highest corner, of a trajectory its
            start.
        by: who may move it.
        arguments: those of follow_trajectory, for a trajectory; of a keep-out box `box`, its name.
    """

    kind: Kind
    points: tuple[Point, ...]
    by: str
    arguments: dict[str, ParameterValue] = field(default_factory=dict)

    @property
    def is_box(self) -> bool:
        return self.kind in ("volume", "keep_out")

    @property
    def grips(self) -> list[tuple[Point, int | None]]:
        """Return the place of each handle and the axis along which it moves, None for the plane."""
        if not self.is_box:
            return [(point, axis) for point in self.points for axis in (None, LEVEL)]
        low, high = self.points
        middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        faces: list[tuple[Point, int | None]] = []
        for axis in range(3):
            for corner in self.points:
                x, y, z = (corner[i] if i == axis else middle[i] for i in range(3))
                faces.append(((x, y, z), axis))
        return faces

    def moved(self, grip: int, place: Point) -> Draft:
        """Return the draft with one handle at another place, to a centimetre and within reach."""
        x, y, z = (round(max(-FARTHEST, min(FARTHEST, c)), 2) for c in place)
        points = list(self.points)
        if not self.is_box:
            points[grip // 2] = (x, y, max(0.0, z))
            return replace(self, points=tuple(points))
        axis, end = divmod(grip, 2)
        corner, other = list(points[end]), points[1 - end][axis]
        limit = round(other + (THINNEST if end else -THINNEST), 2)
        corner[axis] = max((x, y, z)[axis], limit) if end else min((x, y, z)[axis], limit)
        points[end] = (corner[0], corner[1], corner[2])
        return replace(self, points=tuple(points))

    def clicked(self, place: Point) -> Draft:
        """Return the draft after a click on the ground: one way-point more, or its point or box
        above.
        """
        x, y, _ = place
        if self.kind == "volume":
            return self
        if self.kind == "keep_out":
            low, high = self.points
            centre = ((low[0] + high[0]) / 2, (low[1] + high[1]) / 2)
            way = (round(x - centre[0], 2), round(y - centre[1], 2))
            moved = [(round(p + way[0], 2), round(q + way[1], 2), r) for p, q, r in self.points]
            return replace(self, points=tuple(moved)) if is_sound(tuple(moved)) else self
        if self.kind == "waypoints":
            if len(self.points) >= MOST:
                return self
            added = replace(self, points=(*self.points, self.points[-1]))
            return added.moved(2 * len(self.points), (x, y, self.points[-1][2]))
        return self.moved(0, (x, y, self.points[0][2]))


class DraftView:
    """Drawing of the draft, as nodes `/draft/…`, and the pointer on it.

    Args:
        on_edit: called with the draft that the pointer asks for.
    """

    def __init__(self, server: ViewServer, on_edit: Callable[[Draft], None]) -> None:
        self._server, self._on_edit = server, on_edit
        self._api = server.viser.scene
        self._draft: Draft | None = None
        self._marks: list[Mark] = []
        self._cones: list[MeshHandle] = []
        self._grips: dict[str, int] = {}
        self._offset: Point | None = None
        self._box: LineSegmentsHandle | None = None

    def show(self, draft: Draft | None, is_good: bool = True) -> None:
        """Draw a draft, red where the vehicle would refuse it; None takes it away."""
        opens = (draft is None) != (self._draft is None)
        self._draft = draft
        color = PLANNED if is_good else REFUSED
        grips = draft.grips if draft is not None else []
        points = draft.points if draft is not None and not draft.is_box else ()
        self._grips = {}
        for k, point in enumerate(points):
            if k == len(self._marks):
                self._marks.append(Mark(self._api, f"/draft/{k}"))
            mark = self._marks[k]
            several = len(points) > 1
            mark.place(f"{k + 1}" if several else f"{point[2]:.2f} m", point)
            mark.tint(color)
            mark.show_handle(True, (1.0, 0.0, 0.0, 0.0))
            self._grips[mark.handle_name] = 2 * k
        for mark in self._marks[len(points) :]:
            mark.hide()
        along = [(i, place, axis) for i, (place, axis) in enumerate(grips) if axis is not None]
        for k, (i, place, axis) in enumerate(along):
            node = self._cone(k)
            node.position, node.wxyz = place, turns_from_z(np.eye(3)[[axis]])[0]
            node.color, node.visible = color, True
            self._grips[f"/draft/along_{k}"] = i
        for node in self._cones[len(along) :]:
            node.visible = False
        self._show_box(draft, color)
        self._server.offer(self._grips, self._dragged)
        if opens:
            self._listen(draft is not None)

    def _cone(self, k: int) -> MeshHandle:
        if k == len(self._cones):
            node = self._api.add_mesh_simple(
                f"/draft/along_{k}",
                *cones(),
                color=PLANNED,
                opacity=0.75,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            node.on_drag("left")(only_offered)
            self._cones.append(node)
        return self._cones[k]

    def _show_box(self, draft: Draft | None, color: tuple[int, int, int]) -> None:
        if draft is not None and draft.is_box:
            (x0, y0, z0), (x1, y1, z1) = draft.points
            lines = edges(((x0, x1), (y0, y1), (z0, z1)))
            if self._box is None:
                self._box = self._api.add_line_segments(
                    "/draft/box",
                    lines,
                    line_color(PLANNED),
                    thickness=2.0,
                    thickness_units="screen",
                )
            self._box.points, self._box.colors = lines, np.asarray(line_color(color), np.uint8)
        if self._box is not None:
            self._box.visible = draft is not None and draft.is_box

    def _listen(self, listens: bool) -> None:
        """Let browsers offer clicks, which end at the pump as drags do."""
        self._server.on_click = self._clicked if listens else None
        if listens:
            self._api.on_click()(_only_offered)
        else:
            self._api.remove_click_callback(_only_offered)

    def _dragged(self, drag: Drag) -> None:
        draft, grip = self._draft, self._grips.get(drag.name)
        if draft is None or grip is None or drag.who != draft.by:
            return
        place, axis = draft.grips[grip]
        if axis is None:
            met = on_plane(drag.eye, drag.pointer, place, UP)
        else:
            met = along_axis(drag.eye, drag.pointer, place, axis)
        if drag.phase == "start":
            self._offset = None if met is None else _minus(place, met)
        elif met is not None and self._offset is not None:
            wanted = _minus(met, _minus(GROUND, self._offset))
            if (moved := draft.moved(grip, wanted)) != draft:
                self._on_edit(moved)
        if drag.phase == "end":
            self._offset = None

    def _clicked(self, click: Click) -> None:
        draft = self._draft
        if draft is None or click.who != draft.by:
            return
        if any(distance_to_ray(click.eye, click.through, p) < NEAR for p, _ in draft.grips):
            return
        met = on_plane(click.eye, click.through, GROUND, UP)
        if met is not None and max(map(abs, met)) < FARTHEST:
            self._on_edit(draft.clicked(met))


def _only_offered(_: SceneClickEvent) -> None:
    """Do nothing, as `only_offered`."""


def _minus(a: Point, b: Point) -> Point:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def text_of(points: tuple[Point, ...]) -> str:
    """Return way-points in the form that follow_trajectory reads."""
    return "; ".join(" ".join(f"{c:g}" for c in point) for point in points)


def is_sound(points: tuple[Point, ...]) -> bool:
    """Return whether points that came from outside are finite and within reach."""
    return all(math.isfinite(c) and abs(c) <= FARTHEST for point in points for c in point)
