"""Names of the fields of our messages, as the columns of a log call them, by topic.

Axes are x, y, z; quaternions w, x, y, z.
"""

from __future__ import annotations


def axes(stem: str, names: str = "xyz") -> tuple[str, ...]:
    """Return the names of a vector's fields."""
    return tuple(f"{stem}.{name}" for name in names)


# Of imu.
FORCE, RATE = axes("linear_acceleration"), axes("angular_velocity")
# Of state and truth.
POSITION, ATTITUDE = axes("pose.pose.position"), axes("pose.pose.orientation", "wxyz")
VELOCITY_B, TURNING_B = axes("twist.twist.linear"), axes("twist.twist.angular")
ODOMETRY = POSITION + ATTITUDE + VELOCITY_B
# Of tracker_pose and tracker_position.
TRACKED, TRACKED_ATTITUDE = axes("pose.position"), axes("pose.orientation", "wxyz")
MARKED = axes("point")
# Of reference.
REFERENCE = axes("position")
# Of actuators.
THRUSTS = tuple(f"thrusts[{k}]" for k in range(4))
MOTOR_REFERENCES = tuple(f"motor_references[{k}]" for k in range(4))
TORQUE_B = axes("torque")
