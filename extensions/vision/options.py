"""Options of cameras as tracking systems."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from quadlab.option_types import File, Files


@dataclass
class CameraOptions:
    """Options of `quadlab tracker` for cameras."""

    device: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N [N …]")] = (0,)
    """camera and onboard_camera: number of the camera, as in /dev/video0; up to four with
    camera"""
    video: Files = ()
    """camera and onboard_camera: read these video files instead of cameras"""
    rendered: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """camera: render the simulated vehicle as N cameras around the room see it, instead of reading
    cameras"""
    intrinsics: Files = ()
    """camera and onboard_camera: file of the intrinsics of each camera, in their order (default:
    those accepted on the Settings page, or by `quadlab camera`, in the data folder)"""
    tags: File = None
    """camera and onboard_camera: TOML file with the tags and their places, or with the LEDs and how
    often they blink"""
