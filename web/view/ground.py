"""Ground of the 3D view: a grid of 0.5 m."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from web.view.lines import line_color

if TYPE_CHECKING:
    from viser import SceneApi, SceneNodeHandle

CELL, SECTION = (72, 82, 92), (104, 116, 128)
"""Visible on a dark and on a light background."""
SIZE, STEP = 6.0, 0.5  # m, from the middle to an edge, and between two lines


def add_ground(api: SceneApi, *, plain: bool = False) -> SceneNodeHandle:
    """Add the node `/ground`, in place of one of that name.

    Args:
        plain: lines alone. Otherwise each pixel of the ground is computed, with shadows, which
            without a graphics card takes as long as all else in the view.
    """
    if not plain:
        return api.add_grid(
            "/ground",
            width=2.0 * SIZE,
            height=2.0 * SIZE,
            cell_size=STEP,
            section_size=2.0 * STEP,
            cell_color=CELL,
            section_color=SECTION,
            cell_thickness=0.8,
            section_thickness=1.0,
            plane_color=(17, 22, 27),
            plane_opacity=0.0,
            shadow_opacity=0.35,
            fade_distance=18.0,
            fade_strength=1.5,
        )
    along = np.arange(-SIZE, SIZE + STEP, STEP)
    across = np.zeros((len(along), 2, 3), np.float32)
    across[:, :, 0] = along[:, None]
    across[:, :, 1] = (-SIZE, SIZE)
    color = np.array([line_color(SECTION if k % 2 == 0 else CELL) for k in range(len(along))])
    return api.add_line_segments(
        "/ground",
        np.concatenate((across, across[..., [1, 0, 2]])),
        np.tile(color[:, None, :], (2, 2, 1)).astype(np.uint8),
        thickness=1.0,
        thickness_units="screen",
    )
