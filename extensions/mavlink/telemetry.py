"""The messages that the gateway sends by itself, of what the station says of the vehicle.

While the vehicle is not heard there is no heartbeat, so that a ground station sees a lost vehicle.
"""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable

from extensions.mavlink.commands import custom_mode
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin, swap_attitude, swap_body, swap_world
from extensions.mavlink.peer import Peer
from extensions.mavlink.vehicle import Motion, Vehicle
from quadrotor.plain_rotations import roll_pitch_yaw

FASTEST = 0.02
"""Shortest period, in s, that a ground station may ask for."""
TEXT = 50
"""Characters of one STATUSTEXT; longer lines are sent in several."""
TRACKER = mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION | mavlink.MAV_SYS_STATUS_SENSOR_GPS
"""GPS stands for the tracker too, because global positions are made of its poses."""
GYROSCOPE, ARMABLE = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, mavlink.MAV_SYS_STATUS_PREARM_CHECK
MAGNETOMETER = mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
"""Reported although there is none: for MAVSDK a vehicle without one is never healthy."""
SENSORS = TRACKER | GYROSCOPE | ARMABLE | MAGNETOMETER | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
STATES = {
    "starting": mavlink.MAV_STATE_BOOT,
    "ready": mavlink.MAV_STATE_STANDBY,
    "emergency_land": mavlink.MAV_STATE_EMERGENCY,
    "cut": mavlink.MAV_STATE_FLIGHT_TERMINATION,
}
LANDED = {
    "take_off": mavlink.MAV_LANDED_STATE_TAKEOFF,
    "land": mavlink.MAV_LANDED_STATE_LANDING,
    "emergency_landing": mavlink.MAV_LANDED_STATE_LANDING,
}
SEVERITIES = {20: mavlink.MAV_SEVERITY_INFO, 30: mavlink.MAV_SEVERITY_WARNING}
NONE_16 = 65535
NO_COVARIANCE = [math.nan] * 21
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_FLIGHT_TERMINATION
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)


class Telemetry:
    """Makes the messages, and sends each when it is due."""

    def __init__(self, vehicle: Vehicle, origin: Origin) -> None:
        self._vehicle, self._origin = vehicle, origin
        self._first_ns: int | None = None
        self._texts = 0
        of_motion = self._of_motion
        self._periodic: dict[int, tuple[float, Callable[[], MAVLink_message | None]]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: (1.0, self._heartbeat),
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: (1.0, self._sys_status),
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: (2.0, self._battery),
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: (0.5, self._landed),
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: (2.0, self._home),
            mavlink.MAVLINK_MSG_ID_ATTITUDE: (0.05, of_motion(self._attitude)),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: (0.05, of_motion(self._quaternion)),
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: (0.05, of_motion(self._local)),
            mavlink.MAVLINK_MSG_ID_ODOMETRY: (0.05, of_motion(self._odometry)),
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: (0.2, of_motion(self._global)),
        }
        self._makers = {number: maker for number, (_, maker) in self._periodic.items()}
        self._makers[mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION] = self._version

    def send_due(self, peer: Peer, now: float) -> None:
        """Send a ground station the messages that are due; a heartbeat also when it changes.

        Args:
            now: s of a steady clock.
        """
        status = self._vehicle.status
        if status is None:
            return
        shown = status.armed, status.mode, status.behavior
        if shown != peer.shown:
            peer.shown, peer.due[mavlink.MAVLINK_MSG_ID_HEARTBEAT] = shown, now
        for number, (usual, _) in self._periodic.items():
            due = peer.due.get(number, now)
            if now >= due:
                peer.due[number] = max(due + peer.period.get(number, usual), now)
                self.send(peer, number)

    def set_period(self, peer: Peer, number: int, microseconds: float) -> bool:
        """Set a message's period; 0 is the usual one, -1 never. Return whether there is one."""
        if number not in self._periodic:
            return False
        period = max(1e-6 * microseconds, FASTEST) if microseconds else self._periodic[number][0]
        peer.period[number] = period if microseconds >= 0.0 else math.inf
        peer.due[number] = 0.0 if microseconds >= 0.0 else math.inf
        return True

    def send(self, peer: Peer, number: int) -> bool:
        """Send one message; return whether it is known and has contents."""
        message = (
            self._makers[number]() if number in self._makers and self._vehicle.status else None
        )
        if message is not None:
            peer.send(message)
        return message is not None

    def texts(self, line: str, level: int) -> list[MAVLink_message]:
        """Return a line as messages. Level 20 is info, 30 a warning, 40 an error."""
        plain = unicodedata.normalize("NFKD", line)  # m/s² becomes m/s2
        data = plain.encode("ascii", "replace")[: 10 * TEXT]
        # A part that is not full ends the line.
        parts = [data[at : at + TEXT] for at in range(0, len(data) + (len(data) > TEXT), TEXT)]
        self._texts = self._texts % NONE_16 + 1
        number, severity = self._texts if len(parts) > 1 else 0, SEVERITIES.get(level)
        if severity is None:
            severity = mavlink.MAV_SEVERITY_ERROR
        return [
            mavlink.MAVLink_statustext_message(severity, part, number, k)
            for k, part in enumerate(parts)
        ]

    # ------------------------------------------------------------------ messages
    def _heartbeat(self) -> MAVLink_message | None:
        if (status := self._vehicle.status) is None:
            return None
        mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        if status.armed:
            mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        kind = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_GENERIC
        state = STATES.get(status.mode, mavlink.MAV_STATE_ACTIVE)
        return mavlink.MAVLink_heartbeat_message(
            *kind, mode, custom_mode(status.behavior), state, mavlink_version=3
        )

    def _sys_status(self) -> MAVLink_message | None:
        if (status := self._vehicle.status) is None:
            return None
        preflight = self._vehicle.message("preflight")
        ill = TRACKER if self._vehicle.motion is None or "no_pose" in status.flags else 0
        if status.mode == "starting":
            ill |= GYROSCOPE
        if not (status.armed or (preflight is not None and preflight.ready)):
            ill |= ARMABLE
        well = SENSORS & ~ill
        numbers = (0, self._millivolts() or NONE_16, -1, -1, 0, 0, 0, 0, 0, 0)
        return mavlink.MAVLink_sys_status_message(SENSORS, SENSORS, well, *numbers)

    def _battery(self) -> MAVLink_message | None:
        voltage = self._millivolts()
        kind = mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO
        cells = [voltage, *[NONE_16] * 9]  # of the pack as a whole
        unknown = (-1, -1, -1, -1)
        return (
            mavlink.MAVLink_battery_status_message(0, *kind, 32767, cells, *unknown)
            if voltage
            else None
        )

    def _millivolts(self) -> int:
        """Return the battery's voltage, 0 if it is not known."""
        battery = self._vehicle.message("battery")
        if battery is None or not math.isfinite(battery.voltage):
            return 0
        return min(max(round(1e3 * float(battery.voltage)), 0), NONE_16 - 1)

    def _landed(self) -> MAVLink_message | None:
        if (status := self._vehicle.status) is None:
            return None
        state = mavlink.MAV_LANDED_STATE_ON_GROUND
        if status.airborne:
            state = LANDED.get(status.behavior, mavlink.MAV_LANDED_STATE_IN_AIR)
        return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, state)

    def _home(self) -> MAVLink_message | None:
        at, zero = self._origin.place, (0.0, 0.0, 0.0)
        place = round(1e7 * at.latitude), round(1e7 * at.longitude), round(1e3 * at.altitude)
        return mavlink.MAVLink_home_position_message(*place, *zero, [1.0, *zero], *zero)

    def _version(self) -> MAVLink_message | None:
        unknown = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            capabilities=CAPABILITIES,
            flight_sw_version=0,
            middleware_sw_version=0,
            os_sw_version=0,
            board_version=0,
            flight_custom_version=unknown,
            middleware_custom_version=unknown,
            os_custom_version=unknown,
            vendor_id=0,
            product_id=0,
            uid=0,
        )

    def _of_motion(
        self, maker: Callable[[Motion], MAVLink_message]
    ) -> Callable[[], MAVLink_message | None]:
        def made() -> MAVLink_message | None:
            motion = self._vehicle.motion
            return None if motion is None else maker(motion)

        return made

    def _milliseconds(self, motion: Motion) -> int:
        """Return the time since this gateway's first message, which MAVLink calls since boot."""
        if self._first_ns is None or motion.stamp_ns < self._first_ns:
            self._first_ns = motion.stamp_ns
        return (motion.stamp_ns - self._first_ns) // 1_000_000 & 0xFFFF_FFFF

    def _attitude(self, motion: Motion) -> MAVLink_message | None:
        angles = roll_pitch_yaw(*swap_attitude(motion.quaternion_wb))
        rates = swap_body(motion.angular_velocity_b)
        return mavlink.MAVLink_attitude_message(self._milliseconds(motion), *angles, *rates)

    def _quaternion(self, motion: Motion) -> MAVLink_message | None:
        numbers = *swap_attitude(motion.quaternion_wb), *swap_body(motion.angular_velocity_b)
        return mavlink.MAVLink_attitude_quaternion_message(self._milliseconds(motion), *numbers)

    def _local(self, motion: Motion) -> MAVLink_message | None:
        numbers = *swap_world(motion.position_w), *swap_world(motion.velocity_w)
        return mavlink.MAVLink_local_position_ned_message(self._milliseconds(motion), *numbers)

    def _odometry(self, motion: Motion) -> MAVLink_message | None:
        frames = mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_BODY_FRD
        return mavlink.MAVLink_odometry_message(
            1000 * self._milliseconds(motion),
            *frames,
            *swap_world(motion.position_w),
            list(swap_attitude(motion.quaternion_wb)),
            *swap_body(motion.velocity_b),
            *swap_body(motion.angular_velocity_b),
            pose_covariance=NO_COVARIANCE,
            velocity_covariance=NO_COVARIANCE,
        )

    def _global(self, motion: Motion) -> MAVLink_message | None:
        at = self._origin.global_of(motion.position_w)
        place = round(1e7 * at.latitude), round(1e7 * at.longitude), round(1e3 * at.altitude)
        height = round(1e3 * motion.position_w[2])
        speeds = (min(max(round(1e2 * v), -32768), 32767) for v in swap_world(motion.velocity_w))
        yaw = roll_pitch_yaw(*swap_attitude(motion.quaternion_wb))[2]
        heading = round(math.degrees(yaw) % 360.0 * 100.0) % 36000
        return mavlink.MAVLink_global_position_int_message(
            self._milliseconds(motion), *place, height, *speeds, heading
        )
