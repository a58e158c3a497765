"""The errors that refuse unusable measurements."""

from __future__ import annotations

from quadrotor.errors import MeasurementError
from quadrotor.records import MAX_BEACONS, MAX_SENSORS, Record


def refuse_pose(pose: Record) -> MeasurementError:
    """Return the error that refuses a POSE_SAMPLE (1,)."""
    position, quaternion = pose["position_w"][0].tolist(), pose["quaternion_wb"][0].tolist()
    return MeasurementError(
        f"pose with position {position} m and quaternion {quaternion} cannot be used: "
        "allowed are finite positions and quaternions (w, x, y, z) of length 1; check the tracker"
    )


def refuse_bearings(bearings: Record) -> MeasurementError:
    """Return the error that refuses a BEARINGS_SAMPLE (1,)."""
    frame = bearings[0]
    return MeasurementError(
        f"frame of {int(frame['count'])} bearings with sigma {float(frame['sigma'])} rad cannot "
        f"be used: allowed are 1 to {MAX_BEACONS} finite unit vectors to finite places and a "
        "sigma above 0; check the beacon detector"
    )


def refuse_reading(reading: Record) -> MeasurementError:
    """Return the error that refuses a READING_SAMPLE (1,)."""
    one = reading[0]
    return MeasurementError(
        f"reading {float(one['rest'])} from what is expected, with gradient {one['row'].tolist()} "
        f"and deviation {float(one['sigma'])}, cannot be used: allowed are finite numbers and a "
        "deviation above 0"
    )


def refuse_sweeps(sweeps: Record) -> MeasurementError:
    """Return the error that refuses a SWEEPS_SAMPLE (1,)."""
    frame = sweeps[0]
    return MeasurementError(
        f"sweep of {int(frame['count'])} sensors by plane {int(frame['number'])} with sigma "
        f"{float(frame['sigma'])} rad cannot be used: allowed are 1 to {MAX_SENSORS} finite "
        "angles, finite places, a plane with a unit quaternion and a sigma above 0; "
        "check the base stations"
    )
