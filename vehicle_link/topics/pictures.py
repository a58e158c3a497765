"""Camera pictures for people: sensor_msgs/CompressedImage, which Foxglove and RViz show."""

from __future__ import annotations

import numpy as np

from quadrotor.errors import MeasurementError
from vehicle_link.messages import decode, encode, header, new

PICTURE = "sensor_msgs/CompressedImage"
JPEG = b"\xff\xd8"
"""First bytes of every JPEG."""


def encode_picture(stamp_ns: int, jpeg: bytes, frame_id: str) -> bytes:
    """Encode a JPEG; `stamp_ns` is when it was taken."""
    data = np.frombuffer(jpeg, np.uint8)
    return encode(new(PICTURE, header=header(stamp_ns, frame_id), format="jpeg", data=data))


def decode_picture(payload: bytes) -> bytes:
    """Return the JPEG. Raises LinkError; MeasurementError if another node sent no JPEG."""
    jpeg = decode(payload, PICTURE).data.tobytes()
    if not jpeg.startswith(JPEG):
        raise MeasurementError(f"a picture of {len(jpeg)} bytes that is no JPEG; send JPEG")
    return bytes(jpeg)
