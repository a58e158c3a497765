"""Cameras of the pages' 3D views, which move with the vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from quadrotor.plain_rotations import Array
from web.view.ground import add_ground
from web.view.server import ViewServer
from web.view.shapes import Point, Quaternion, matrix_of

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle

Camera = Literal["free", "follow", "top", "side", "first"]
OFFSETS = {"top": (0.0, -0.02, 4.5), "side": (0.0, -3.2, 0.4)}
"""Where a camera is put, from the vehicle, m, world: x to the right, y or z up. From there it can
be turned and zoomed while it follows."""
EYE, AHEAD = (0.16, 0.0, 0.06), (2.0, 0.0, 0.06)
"""The first-person camera and the point that it looks at, m, body axes; its horizon stays level."""
STILL = 0.002  # m


class Cameras:
    """Cameras by the name of the page's view; cameras that nobody chose are free."""

    def __init__(self, server: ViewServer) -> None:
        self._server = server
        self.shows_ground = True
        self._chosen: dict[str, Camera] = {}
        self._unplaced: set[str] = set()
        self._plain: dict[
            str, ClientHandle | None
        ] = {}  # view that is drawn simply → its client that was told

    def choose(self, view: str, camera: Camera) -> None:
        self._chosen.pop(view, None)
        self._unplaced.discard(view)
        if camera != "free":
            self._chosen[view] = camera
            self._unplaced.add(view)

    def simplify(self, view: str, *, plain: bool) -> None:
        """Draw one page's view without shadows and with a ground of lines alone, or completely."""
        client = self._server.clients_of({view}).get(view)
        if plain:
            self._plain[view] = None
        elif self._plain.pop(view, None) is not None and client is not None:
            self._draw(client, plain=False)

    def tell_new(self) -> None:
        """Tell clients that connected since; to be called now and then."""
        plain = self._server.clients_of(set(self._plain)) if self._plain else {}
        for view, client in plain.items():
            if self._plain[view] is not client:
                self._plain[view] = client
                self._draw(client, plain=True)

    def _draw(self, client: ClientHandle, *, plain: bool) -> None:
        client.scene.configure_default_lights(cast_shadow=not plain)
        add_ground(client.scene, plain=plain).visible = self.shows_ground

    def move(self, position: Point, quaternion: Quaternion) -> None:
        """Move the cameras with the vehicle's pose, body to world."""
        if not self._chosen:
            return
        point = np.asarray(position, float)
        for view, client in self._server.clients_of(set(self._chosen)).items():
            camera, chosen = client.camera, self._chosen[view]
            if chosen == "first":
                turn = matrix_of(quaternion)
                _put(camera, point + turn @ EYE, point + turn @ AHEAD)
                continue
            offset = camera.position - camera.look_at
            if view in self._unplaced and chosen in OFFSETS:
                offset = np.array(OFFSETS[chosen])
                _put(camera, point + offset, point)
            elif np.linalg.norm(point - camera.look_at) > STILL:
                _put(camera, point + offset, point)
            self._unplaced.discard(view)


def _put(camera: CameraHandle, position: Array, look_at: Array) -> None:
    if (
        np.linalg.norm(position - camera.position) + np.linalg.norm(look_at - camera.look_at)
        > STILL
    ):
        camera.position = position
        camera.look_at = look_at
