"""The parameters of simulated cameras, as `quadlab fly --set camera.enabled=true`."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class CameraParameters(Parameters):
    """The camera on the simulated vehicle; its mount, rate and delay are those of `bearings`."""

    enabled: bool = parameter(False)
    """bearings are found in rendered pictures of the beacons, not emulated"""
    markers: str = parameter("tags", choices=("tags", "leds"))
    """what the beacons are: printed tags, or LEDs that blink 2, 3, 4, … times a second"""
    field_of_view: float = parameter(90.0, unit="°", ge=20, le=130, step=5)
    """across the picture of 640 x 480"""
    tag_size: float = parameter(0.2, unit="m", ge=0.02, le=1, step=0.01)
    """side of the tags' black square"""
    position_x: float = parameter(0.05, unit="m", ge=-1, le=1, step=0.01)
    """of the lens, body axes"""
    position_y: float = parameter(0.0, unit="m", ge=-1, le=1, step=0.01)
    """of the lens, body axes"""
    position_z: float = parameter(-0.03, unit="m", ge=-1, le=1, step=0.01)
    """of the lens, body axes"""
    exposure: float = parameter(0.004, unit="s", ge=0, le=0.03, step=0.001)
    """of each row; moving tags smear"""
    readout: float = parameter(0.0, unit="s", ge=0, le=0.03, step=0.001)
    """of a rolling shutter, of all rows"""
    sigma: float = parameter(0.2, unit="°", ge=0.01, le=20, step=0.01)
    """stated in addition to the corners' noise"""
    pictures: float = parameter(5.0, unit="Hz", ge=0, le=30, step=1)
    """pictures a second that the log has at most, tags marked; 0 has none"""


class OutsideCameraParameters(Parameters):
    """Cameras around the room that track the vehicle's tags, instead of the simulated tracker."""

    number: int = parameter(0, ge=0, le=4, step=1)
    """cameras; 0 leaves the simulated tracker in place"""
    rate: float = parameter(30.0, unit="Hz", ge=1, le=60, step=1)
    """pictures a second of each, in turn"""
    delay: float = parameter(0.04, unit="s", ge=0, le=0.5, step=0.005)
    """from the exposure to the arrival of the pose"""
    exposure: float = parameter(0.004, unit="s", ge=0, le=0.03, step=0.001)
    """of each picture; moving tags smear"""
    covered: int = parameter(0, ge=0, le=4, step=1)
    """camera that is covered, from 1; 0 covers none"""
    covered_from: float = parameter(0.0, unit="s", ge=0, le=3600, step=1)
    """when it is covered"""
    misplaced: float = parameter(0.0, unit="m", ge=-1, le=1, step=0.01)
    """by which the told place of the last camera is too high"""
    pictures: float = parameter(5.0, unit="Hz", ge=0, le=30, step=1)
    """pictures a second of each that the log has at most, tags marked; 0 has none"""
