"""A camera's picture for people: small, with the detected tags marked.

The marks are drawn into the picture instead of being sent next to it, so that the page, the log,
Foxglove and the replay all show the same, and the marks always belong to their picture.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from estimation.tags.detector import Picture, Tags
from quadrotor.errors import MeasurementError

WIDEST = 640
"""Width in pixels above which a picture is reduced."""
QUALITY = 75
"""JPEG quality in percent: a rendered picture of 640 x 480 pixels has 14 kB."""
USED, UNUSED, SHADE = (120, 220, 60), (40, 170, 255), (20, 20, 20)  # blue, green, red


def marked_picture(grey: Picture, tags: Tags, used: Collection[int]) -> bytes:
    """Return a JPEG of the picture with outline, first corner and number of each tag: green if the
    tag is one of `used`, amber if it is unknown.

    Raises MeasurementError when OpenCV cannot encode it.
    """
    import cv2

    scale = min(1.0, WIDEST / grey.shape[1])
    if scale < 1.0:
        grey = np.asarray(
            cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8
        )
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    for number, corners in sorted(tags.items()):
        colour = USED if number in used else UNUSED
        outline = np.round((corners + 0.5) * scale - 0.5).astype(np.int32)
        cv2.polylines(picture, [outline], True, colour, 2, cv2.LINE_AA)
        cv2.circle(picture, outline[0].tolist(), 4, colour, -1, cv2.LINE_AA)
        right, middle = outline[:, 0].max(), outline[:, 1].mean()
        place = (int(right) + 5, int(middle) + 5)
        for shade, width in ((SHADE, 5), (colour, 2)):
            font = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(picture, str(number), place, font, 0.8, shade, width, cv2.LINE_AA)
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise MeasurementError(f"a picture of {picture.shape} cannot be made a JPEG")
    return bytes(data.tobytes())
