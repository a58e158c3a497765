"""A camera on the simulated vehicle: its pictures are rendered, and read as real pictures are.

Beacons are tags in the plane of their layout that face the middle of the room, or LEDs behind a
diffuser, with a short exposure in which little else is bright.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bearing_sim.beacons import Beacons, parse_layout
from bearing_sim.bearing_parameters import parse_lost
from bearing_sim.emulator import BearingMeasurement, BearingParameters
from bearing_sim.sampling import SECOND_NS, DelayLine, InstantGrid
from extensions.vision.simulated.camera_motion import CameraMotion
from extensions.vision.simulated.parameters import CameraParameters
from extensions.vision.simulated.rendered_camera import Pattern, RenderedCamera
from extensions.vision.tags.beacon_markers import BeaconMarkers, Mount
from extensions.vision.tags.detector import Picture, TagDetector, marked_picture
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.led_bearings import bearing_reader
from quadlab.simulated.parameters import FlightParameters
from quadlab.simulated.sensors import Replacements
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

WIDTH, HEIGHT = 640, 480
IN_TIME = 0.9
"""Share of the period after which a picture for people counts as due."""
MIDDLE = np.array([0.0, 0.0, 1.0])
"""Middle of the room, m, world axes."""
LED_SIZE, PLATE = 0.03, 0.045
"""Diameter of an LED's diffuser, and side of the black plate that it is on, m."""
DIM, BRIGHT, DARK = 90, 230, 8.0
"""Grey levels of an LED, and of the room behind it."""
_ACROSS = np.linspace(-0.5, 0.5, 24) * PLATE
DISC = np.hypot(_ACROSS, _ACROSS[:, None]) < 0.5 * LED_SIZE
"""Pixels of the plate's picture that are lit."""


class OnboardCamera:
    """A camera that replaces a `bearing_sim.BearingEmulator`.

    Args:
        estimated_w: the vehicle's estimated position, a view that shows its current value.

    Attributes:
        lens: of the camera.
        pictures: number taken; unread: number of those without a bearing.
    """

    def __init__(
        self,
        bearings: BearingParameters,
        camera: CameraParameters,
        estimated_w: Array | None = None,
    ) -> None:
        self.parameters, self._camera = bearings, camera
        p, self._text = bearings, ""
        focal = 0.5 * WIDTH / math.tan(0.5 * math.radians(camera.field_of_view))
        matrix = np.array([[focal, 0.0, 322.0], [0.0, focal, 238.0], [0.0, 0.0, 1.0]])
        self._rendered = RenderedCamera(
            WIDTH, HEIGHT, matrix, exposure=camera.exposure, readout=camera.readout
        )
        self._leds: dict[int, float] = {}
        if camera.markers == "leds":
            self._rendered = replace(self._rendered, background=DARK)
            self._leds = {n: 2.0 + k for k, n in enumerate(self.beacons.ids.tolist())}
        mount = Mount(
            position=(camera.position_x, camera.position_y, camera.position_z),
            turn=(p.mount_roll, p.mount_pitch, p.mount_yaw),
        )
        self.lens = Intrinsics(WIDTH, HEIGHT, matrix, self._rendered.distortion)
        size = None if self._leds else camera.tag_size
        markers = BeaconMarkers(size=size, leds=self._leds, camera=mount, sigma=camera.sigma)
        self._reader, self._prints = bearing_reader(markers, self.lens), TagDetector(self.lens)
        self._estimated_w = estimated_w
        self._R_bc, self._lens_b = mount.axes_b, np.array(mount.position)
        self._random = np.random.default_rng(p.seed)
        self._grid, self._motion = InstantGrid(), CameraMotion()
        self._line: DelayLine[BearingMeasurement] = DelayLine()
        self.pictures = self.unread = 0
        self._shown: list[tuple[str, int, bytes]] = []
        self._shown_ns: int | None = None

    def shown(self) -> list[tuple[str, int, bytes]]:
        """Return topics, stamps and JPEGs of the pictures for people since the last call."""
        shown, self._shown = self._shown, []
        return shown

    def said(self) -> list[str]:
        """Return no lines: bearings that do not fit are judged by who reads them."""
        return []

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Observe the true pose, as `BearingEmulator.observe` does."""
        after_ns = self._motion.add(stamp_ns, position_w, quaternion_wb)
        if after_ns is None:
            return
        motion = self._motion
        for instant_ns in self._grid.between(after_ns, stamp_ns, self.parameters.rate):
            at = motion.at(instant_ns)
            picture = self.picture(*at, motion.velocity_w, motion.turning_b, instant_ns)
            self._read(instant_ns, picture)

    def due(self, now_ns: int) -> list[BearingMeasurement]:
        """Return the frames that have arrived by `now_ns`, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        return self._line.next_ns

    @property
    def beacons(self) -> Beacons:
        return parse_layout(self.parameters.layout)

    def picture(
        self, position_w: Array, R_wb: Array, velocity_w: Array, turning_b: Array, stamp_ns: int = 0
    ) -> Picture:
        """Return what the camera sees from a vehicle with this pose and motion: m/s, rad/s."""
        beacons, lost = self.beacons, parse_lost(self.parameters.lost)
        R_wt = _facing(beacons)
        to_camera, patterns = self._R_bc.T, []
        for number, place_w in zip(beacons.ids.tolist(), beacons.positions_w, strict=True):
            if lost is None or number in lost:
                continue
            from_body = R_wb.T @ (place_w - position_w)
            picture, wide = self._marker(number, 1e-9 * stamp_ns)
            patterns.append(
                Pattern(
                    picture,
                    (wide, wide),
                    to_camera @ (from_body - self._lens_b),
                    to_camera @ R_wb.T @ R_wt,
                    to_camera @ (-np.cross(turning_b, from_body) - R_wb.T @ velocity_w),
                    -to_camera @ turning_b,
                )
            )
        return self._rendered.take(patterns, self._random)

    def _marker(self, number: int, at: float) -> tuple[Picture, float]:
        """Return the picture of a beacon at a time (s), and its side in m."""
        if not self._leds:
            picture = self._prints.picture(number)
            return picture, self._camera.tag_size * len(picture) / (len(picture) - 2)
        # No two LEDs start together, and none keeps its rate exactly.
        turns = 1.002 * self._leds[number] * at + 0.37 * number
        return np.where(DISC, DIM if turns % 1.0 < 0.5 else BRIGHT, 0).astype(np.uint8), PLATE

    def _read(self, stamp_ns: int, grey: Picture) -> None:
        p = self.parameters
        self.pictures += 1
        try:
            beacons = self.beacons
            places = dict(zip(beacons.ids.tolist(), beacons.positions_w, strict=True))
            seen = self._reader.take(grey, stamp_ns, places, self._estimated_w)
        except MeasurementError:  # withheld, as in the tracker process
            self.unread += 1
            return
        finally:
            self._show(stamp_ns, grey)
        self.unread += not seen.beacon_ids
        frame = BearingMeasurement(
            stamp_ns + round(p.stamp_error * SECOND_NS),
            np.array(seen.beacon_ids, np.int32),
            seen.bearings_b,
            seen.sigma,
            self.beacons,
        )
        late = p.delay + p.jitter * self._random.random()
        self._line.put(stamp_ns + round(late * SECOND_NS), frame)

    def _show(self, stamp_ns: int, grey: Picture) -> None:
        rate, last = self._camera.pictures, self._shown_ns
        if rate and (last is None or stamp_ns - last >= IN_TIME * SECOND_NS / rate):
            used = self.beacons.ids.tolist()
            jpeg = marked_picture(grey, self._reader.tags, used)
            self._shown.append(("camera_picture", stamp_ns, jpeg))
            self._shown_ns = stamp_ns


def _facing(beacons: Beacons) -> Array:
    """Return R_wt of tags in the plane of the beacons that face the middle of the room."""
    z = beacons.normal_w * math.copysign(1.0, float((MIDDLE - beacons.center_w) @ beacons.normal_w))
    x = np.cross([0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def make(
    parameters: FlightParameters, camera: CameraParameters, estimated_w: Array
) -> Replacements:
    """Return the camera, if it is enabled, which replaces the emulated bearings."""
    if not camera.enabled:
        return Replacements()
    return Replacements(bearings=OnboardCamera(parameters.bearings, camera, estimated_w))
