"""Camera message in the form that viser's client sends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def camera_message(position: Sequence[float]) -> dict[str, Any]:
    """Return the message of a camera at this place that looks at the origin."""
    return {
        "type": "ViewerCameraMessage",
        "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": list(position),
        "fov": 1.0,
        "near": 0.01,
        "far": 100.0,
        "image_height": 400,
        "image_width": 640,
        "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 0.0, 1.0],
    }
