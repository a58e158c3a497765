"""Keep-out boxes of the 3D view: translucent, with their names over them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from control.keep_out import KeepOut
from web.view.lines import REFUSED

if TYPE_CHECKING:
    from viser import BoxHandle, LabelHandle, SceneApi


class BoxesView:
    """Drawing of the keep-out boxes, as nodes `/keep_out/…`, of which the k-th shows the k-th box.

    Nodes are hidden when not needed, because viser keeps a tombstone of every removed one.
    """

    def __init__(self, api: SceneApi) -> None:
        self._api = api
        self._boxes: KeepOut = ()
        self._visible = True
        self._nodes: list[tuple[BoxHandle, LabelHandle]] = []

    def set_boxes(self, boxes: KeepOut) -> None:
        """Draw these boxes in place of the previous ones."""
        if boxes == self._boxes:
            return
        self._boxes = boxes
        for k, box in enumerate(boxes):
            if k == len(self._nodes):
                solid = self._api.add_box(
                    f"/keep_out/{k}",
                    REFUSED,
                    opacity=0.25,
                    side="double",
                    cast_shadow=False,
                    receive_shadow=False,
                )
                label = self._api.add_label(
                    f"/keep_out/{k}_name", "", font_screen_scale=0.85, anchor="bottom-center"
                )
                self._nodes.append((solid, label))
            solid, label = self._nodes[k]
            x, y, z = ((a + b) / 2 for a, b in zip(box.low_w, box.high_w, strict=True))
            solid.position = (x, y, z)
            width, depth, height = (b - a for a, b in zip(box.low_w, box.high_w, strict=True))
            solid.dimensions = (width, depth, height)
            label.position, label.text = (x, y, box.high_w[2]), box.name
        self.show(self._visible)

    def show(self, visible: bool) -> None:
        """Show or hide the layer."""
        self._visible = visible
        for k, nodes in enumerate(self._nodes):
            for node in nodes:
                node.visible = visible and k < len(self._boxes)
