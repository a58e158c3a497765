"""Cameras around the simulated room: pictures are rendered, read and fused as real ones are."""

from __future__ import annotations

import numpy as np

from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.sampling import SECOND_NS, DelayLine, InstantGrid
from extensions.vision.simulated.camera_motion import CameraMotion
from extensions.vision.simulated.camera_scene import LENS, STANDS, TAGS, Scene, layout
from extensions.vision.simulated.parameters import OutsideCameraParameters
from extensions.vision.tags.camera_fusion import CameraFusion
from extensions.vision.tags.detector import Picture, marked_picture
from extensions.vision.tags.tag_layout import CameraPlace
from extensions.vision.tags.tag_tracker import TagTracker
from extensions.vision.tracker.several_cameras import disagreements_of
from quadlab.simulated.parameters import FlightParameters
from quadlab.simulated.sensors import Replacements
from quadrotor.errors import MeasurementError
from quadrotor.plain_rotations import Array
from vehicle_link.topics.table import TRACKER_PICTURES

BODY = "quad1"
IN_TIME = 0.9
"""Share of the period after which a picture for people counts as due."""
SAID_NS = 2 * SECOND_NS
"""Shortest time in ns between two lines about the same camera."""


class OutsideCameras:
    """Cameras that replace a `bearing_sim.SimulatedTracker`; they expose one after the other.

    Attributes:
        pictures: number taken.
        off: squared error of each pose sent, m^2.
    """

    def __init__(self, parameters: OutsideCameraParameters, seed: int) -> None:
        self.parameters = p = parameters
        count = p.number
        self._scene = Scene(seed, p.exposure)
        self._stands = STANDS[:count]
        told = {str(k): stand for k, stand in enumerate(self._stands)}
        if p.misplaced:
            last = self._stands[-1]
            x, y, z = last.position
            a, b, c = last.looks_at
            told[str(count - 1)] = CameraPlace(
                position=(x, y, z + p.misplaced), looks_at=(a, b, c + p.misplaced)
            )
        tags = layout(BODY, told)
        self._trackers = [TagTracker(tags, LENS, name, is_alone=count == 1) for name in told]
        self._fusion, self._names = CameraFusion(count), list(told)
        self._grid, self._motion = InstantGrid(), CameraMotion()
        self._line: DelayLine[PoseMeasurement] = DelayLine()
        self.pictures = 0
        self.off: list[float] = []
        self._shown: list[tuple[str, int, bytes]] = []
        self._shown_ns: dict[int, int] = {}
        self._lines: list[str] = []
        self._said_ns: dict[str, int] = {}

    def shown(self) -> list[tuple[str, int, bytes]]:
        """Return topics, stamps and JPEGs of the pictures for people since the last call."""
        shown, self._shown = self._shown, []
        return shown

    def said(self) -> list[str]:
        """Return the problems since the last call, in the words of the tracker's process."""
        lines, self._lines = self._lines, []
        return lines

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Observe the true pose, as `SimulatedTracker.observe` does."""
        after_ns = self._motion.add(stamp_ns, position_w, quaternion_wb)
        if after_ns is None:
            return
        motion, count = self._motion, len(self._trackers)
        rate = self.parameters.rate * count
        for instant_ns in self._grid.between(after_ns, stamp_ns, rate):
            at, camera = motion.at(instant_ns), round(1e-9 * instant_ns * rate) % count
            stand = self._stands[camera]
            grey = self._scene.picture(stand, *at, motion.velocity_w, motion.turning_b)
            if self._is_covered(camera, instant_ns):
                grey = np.zeros_like(grey)
            if (place_w := self._read(camera, instant_ns, grey)) is not None:
                self.off.append(float(np.sum((place_w - at[0]) ** 2)))

    def due(self, now_ns: int) -> list[PoseMeasurement]:
        """Return the poses that have arrived by `now_ns`, in order."""
        return self._line.due(now_ns)

    @property
    def next_ns(self) -> int | None:
        return self._line.next_ns

    def _is_covered(self, camera: int, at_ns: int) -> bool:
        p = self.parameters
        return camera == p.covered - 1 and 1e-9 * at_ns >= p.covered_from

    def _read(self, camera: int, stamp_ns: int, grey: Picture) -> Array | None:
        self.pictures += 1
        tracker = self._trackers[camera]
        try:
            seen = tracker.take(grey).get(BODY)
        except MeasurementError as error:  # withheld, as in the tracker process
            self._say(f"camera {camera}: {error}", f"camera {camera}", stamp_ns)
            seen = None
        self._show(camera, stamp_ns, grey)
        found = None if seen is None else self._fusion.take(camera, stamp_ns, seen)
        for line in disagreements_of(BODY, self._fusion, self._names):
            self._say(line, "disagreement", stamp_ns)
        if found is not None:
            late_ns = round(self.parameters.delay * SECOND_NS)
            pose = PoseMeasurement(stamp_ns, found.position_w, found.quaternion_wb)
            self._line.put(stamp_ns + late_ns, pose)
        return None if found is None else found.position_w

    def _say(self, line: str, about: str, now_ns: int) -> None:
        if now_ns - self._said_ns.get(about, -SAID_NS) >= SAID_NS:
            self._said_ns[about] = now_ns
            self._lines.append(line)

    def _show(self, camera: int, stamp_ns: int, grey: Picture) -> None:
        rate, last = self.parameters.pictures, self._shown_ns.get(camera)
        if rate and (last is None or stamp_ns - last >= IN_TIME * SECOND_NS / rate):
            jpeg = marked_picture(grey, self._trackers[camera].tags, TAGS.keys())
            self._shown.append((TRACKER_PICTURES[camera], stamp_ns, jpeg))
            self._shown_ns[camera] = stamp_ns


def make(
    parameters: FlightParameters, cameras: OutsideCameraParameters, estimated_w: Array
) -> Replacements:
    """Return the cameras, if there are any, which replace the simulated tracker."""
    if not cameras.number:
        return Replacements()
    return Replacements(poses=OutsideCameras(cameras, parameters.tracker.seed))
