"""Beacons as nodes of the 3D view: ball, post and id, and the handle that drags one.

Slot k shows the k-th beacon of the layout. Slots are created when first needed and hidden when not:
viser keeps a tombstone of every removed node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bearing_sim.beacons import Beacons
from quadrotor.plain_rotations import Array
from web.view.shapes import IDENTITY, Point, Quaternion, handle, turns_from_z

if TYPE_CHECKING:
    from viser import IcosphereHandle, MeshHandle, SceneApi, SceneNodeDragEvent

SEEN, UNSEEN = (224, 196, 110), (122, 128, 134)
HANDLE = (224, 196, 110)
POST = (90, 102, 114)
RADIUS = 0.045  # m
THINNEST = 0.01  # m, the height of a post on the ground


class Mark:
    """Nodes of one marked point, such as a beacon: ball, post to the ground, label and handle."""

    def __init__(self, api: SceneApi, name: str) -> None:
        self.id: int | str | None = None
        self.frame = api.add_frame(name, show_axes=False, visible=False)
        self.ball = api.add_icosphere(
            f"{name}/ball", radius=RADIUS, subdivisions=2, color=SEEN, cast_shadow=False
        )
        self.post = api.add_cylinder(
            f"{name}/post", radius=0.008, height=1.0, color=POST, cast_shadow=False
        )
        self.label = api.add_label(
            f"{name}/id",
            "",
            position=(0.0, 0.0, 0.1),
            font_screen_scale=0.85,
            anchor="bottom-center",
        )
        self.handle_name = f"{name}/handle"
        self._api = api
        self._handle: MeshHandle | None = None
        self._wanted: IcosphereHandle | None = None

    def place(self, id: int | str, position: Point) -> None:
        z = position[2]
        self.post.scale = (1.0, 1.0, max(abs(z), THINNEST))
        self.post.position = (0.0, 0.0, -0.5 * z)
        self.frame.position = position
        if id != self.id:
            self.id = id
            self.label.text = str(id)
        self.frame.visible = True

    def tint(self, color: tuple[int, int, int]) -> None:
        self.ball.color = color
        if self._handle is not None:
            self._handle.color = color

    def hide(self) -> None:
        self.id = None
        self.frame.visible = False
        self.want(None)

    def show_handle(self, shown: bool, turn: Quaternion | Array) -> None:
        if self._handle is None:
            if not shown:
                return
            self._handle = self._api.add_mesh_simple(
                self.handle_name,
                *handle(),
                color=HANDLE,
                opacity=0.3,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
                wxyz=turn,
            )
            self._handle.on_drag("left")(only_offered)
        self._handle.wxyz = turn
        self._handle.visible = shown

    def want(self, position: Point | None) -> None:
        """Show a pale ball where a beacon was dragged to, until confirmed; None hides it."""
        if self._wanted is None:
            if position is None:
                return
            self._wanted = self._api.add_icosphere(
                f"{self.handle_name}_wanted",
                radius=RADIUS,
                color=SEEN,
                opacity=0.35,
                cast_shadow=False,
            )
        if position is not None:
            self._wanted.position = np.subtract(position, self.frame.position)
        self._wanted.visible = position is not None


class BeaconMarks:
    """Beacons of the layout as the nodes `/beacons/<slot>/…`.

    Args:
        api: viser's scene.
    """

    def __init__(self, api: SceneApi) -> None:
        self._api = api
        self._slots: list[Mark] = []
        self._handles_shown = False
        self._turn: Quaternion | Array = IDENTITY
        self.beacons: Beacons | None = None
        self.places: dict[int, Point] = {}
        api.add_frame("/beacons", show_axes=False)

    def show(self, beacons: Beacons) -> None:
        self.beacons = beacons
        rows = beacons.positions_w.tolist()
        self.places = {
            id: (x, y, z) for id, (x, y, z) in zip(beacons.ids.tolist(), rows, strict=True)
        }
        while len(self._slots) < len(self.places):
            self._slots.append(Mark(self._api, f"/beacons/{len(self._slots)}"))
        self._turn = turns_from_z(beacons.normal_w[None])[0]
        for slot, (id, position) in zip(self._slots, self.places.items(), strict=False):
            slot.place(id, position)
        for slot in self._slots[len(self.places) :]:
            slot.hide()
        self.show_handles(self._handles_shown)

    def show_handles(self, shown: bool) -> None:
        self._handles_shown = shown
        for slot in self._slots:
            slot.show_handle(shown and slot.id is not None, self._turn)

    @property
    def handles(self) -> dict[str, int]:
        """Return the names of the handles that are shown, and the beacon that each drags."""
        if not self._handles_shown:
            return {}
        return {slot.handle_name: slot.id for slot in self._slots if isinstance(slot.id, int)}

    def light(self, ids: frozenset[int]) -> None:
        """Colour the visible beacons and grey the others."""
        for slot in self._slots:
            if slot.id is not None:
                slot.ball.color = SEEN if slot.id in ids else UNSEEN

    def want(self, positions: dict[int, Point]) -> None:
        for slot in self._slots:
            slot.want(positions.get(slot.id) if isinstance(slot.id, int) else None)


async def only_offered(_: SceneNodeDragEvent[MeshHandle]) -> None:
    """Do nothing: a callback only makes the browser offer the drag or click, whose messages end at
    the pump.
    """
