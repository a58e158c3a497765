"""Observability map: the position bound over a horizontal slice, computed in a thread."""

from __future__ import annotations

import math
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bearing_sim.beacons import Beacons
from bearing_sim.observability import FieldOfView, bound_map
from control.behaviors.parameters import Box
from web.view.beacons.bound_image import Scale, legend, picture

if TYPE_CHECKING:
    from viser import ImageHandle, SceneApi

PERIOD = 0.2  # shortest time between two maps, in s, as when a beacon is dragged
SPACING = 0.1  # shortest spacing, m
MOST = 80  # largest number of points along a side
NODE = "/bound"


@dataclass(frozen=True)
class MapRequest:
    """Inputs of a map."""

    beacons: Beacons
    sigma: float  # rad
    sight: FieldOfView
    volume: Box
    height: float  # m


class BoundSlice:
    """Node `/bound`. `update` does not block: a thread computes the newest request."""

    def __init__(self, api: SceneApi) -> None:
        self._api = api
        self._node: ImageHandle | None = None
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="bound-map")
        self._work: Future[Scale | None] | None = None
        self._working_on: MapRequest | None = None
        self._drawn: MapRequest | None = None
        self._begun = -math.inf
        self.scale: Scale | None = None

    def update(self, request: MapRequest | None, now: float) -> bool:
        """Start the computation of a request, and show a finished map; None hides the map.

        Return whether the scale has changed.
        """
        before = self.scale
        if self._work is not None and self._work.done():
            self.scale, self._drawn = self._work.result(), self._working_on
            self._work = None
        is_time = now - self._begun >= PERIOD or now < self._begun
        if request is not None and self._work is None and request != self._drawn and is_time:
            self._begun, self._working_on = now, request
            self._work = self._worker.submit(self._draw, request)
        if request is None:
            self.scale, self._drawn = None, None
        if self._node is not None:
            self._node.visible = request is not None and self.scale is not None
        return self.scale != before

    def legend(self) -> dict[str, object] | None:
        """Return the legend of the map that is shown, or None."""
        return None if self.scale is None else legend(self.scale)

    def _draw(self, request: MapRequest) -> Scale | None:
        """Compute numbers, picture and node in the worker."""
        (x_low, x_high), (y_low, y_high), _ = request.volume
        width, depth = x_high - x_low, y_high - y_low
        if not (width > 0.0 and depth > 0.0):
            return None
        spacing = max(SPACING, width / MOST, depth / MOST)
        found = bound_map(
            request.beacons,
            request.sigma,
            *request.volume[:2],
            request.height,
            sight=request.sight,
            spacing=spacing,
        )
        scale = Scale.of(found.position)
        if scale is None:
            return None
        image = picture(found.position, scale)
        if self._node is None:
            self._node = self._api.add_image(
                NODE, image, width, depth, format="png", cast_shadow=False, visible=False
            )
        else:
            self._node.image = image
            self._node.render_width, self._node.render_height = width, depth
        self._node.position = (0.5 * (x_low + x_high), 0.5 * (y_low + y_high), request.height)
        return scale
