"""Topics: records of a tick to payloads and back."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest

from quadrotor.errors import LinkError, MeasurementError
from quadrotor.records import NO_ATTITUDE, POSE_SAMPLE, TICK, Record, beacon_ids_of
from quadrotor.rotations import rotate_inverse
from vehicle_link.messages import TYPESTORE, decode, encode, header, new, stamp_of, stored_name
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import decode_change, encode_change
from vehicle_link.topics.control_inputs import (
    decode_external_reference,
    decode_heartbeat,
    decode_joy,
    encode_heartbeat,
    encode_joy,
)
from vehicle_link.topics.measurements import (
    decode_bearings,
    decode_pose,
    decode_position,
    encode_bearing_pose,
    encode_bearings,
    pose_messages,
    position_messages,
)
from vehicle_link.topics.status import (
    encode_batteries,
    encode_estimators,
    encode_event,
    encode_pressures,
    encode_status,
)
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.topics.ticks import (
    FEW,
    actuator_messages,
    decode_imu,
    decode_odometry,
    decode_odometry_pose,
    imu_messages,
    reference_messages,
    state_messages,
)

SEED = 1977
STAMP = 1_700_000_000_123_456_789


def _ticks(count: int = 4) -> Record:
    """Return ticks with random floats, unit quaternions, and stamps 2 ms apart."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    ticks = np.zeros(count, TICK)
    for part in ("imu", "state", "reference", "actuators", "estimate", "status"):
        for name in TICK[part].names or ():
            if TICK[part][name].base.kind == "f":
                ticks[part][name] = rng.normal(size=ticks[part][name].shape)
    quaternions = ticks["state"]["quaternion_wb"]
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    ticks["imu"]["stamp_ns"] = STAMP + 2_000_000 * np.arange(count)
    return ticks


def test_state_survives_as_odometry() -> None:
    ticks = _ticks()
    for tick, payload in zip(ticks, payloads_of(state_messages(ticks)), strict=True):
        stamp, state = decode_odometry(payload)
        assert stamp == tick["imu"]["stamp_ns"]
        for name in state.dtype.names or ():
            np.testing.assert_allclose(state[name][0], tick["state"][name], atol=1e-14)


def test_odometry_twist_is_in_body_axes_and_its_quaternion_in_ros_order() -> None:
    ticks = _ticks(1)
    message = decode(state_messages(ticks).tobytes(), "nav_msgs/Odometry")
    state = ticks["state"][0]
    q = message.pose.pose.orientation
    np.testing.assert_array_equal([q.w, q.x, q.y, q.z], state["quaternion_wb"])
    expected = rotate_inverse(state["quaternion_wb"], state["velocity_w"])
    linear = message.twist.twist.linear
    np.testing.assert_allclose([linear.x, linear.y, linear.z], expected, atol=1e-14)
    assert (message.header.frame_id, message.child_frame_id) == ("world", "quad1/body")
    assert stamp_of(message) == STAMP


def test_odometry_of_a_foreign_node_is_read_too() -> None:
    ticks = _ticks(1)
    message = decode(state_messages(ticks).tobytes(), "nav_msgs/Odometry")
    message.header.frame_id = "map"
    stamp, state = decode_odometry(encode(message))
    assert stamp == STAMP
    np.testing.assert_allclose(state["velocity_w"][0], ticks["state"]["velocity_w"][0], atol=1e-14)
    np.testing.assert_array_equal(state["quaternion_wb"], ticks["state"]["quaternion_wb"])


@pytest.mark.parametrize("frame", ["world", "map"])
def test_the_pose_alone_is_that_of_the_whole_odometry(frame: str) -> None:
    message = decode(state_messages(_ticks(1)).tobytes(), "nav_msgs/Odometry")
    message.header.frame_id = frame
    stamp, state = decode_odometry(encode(message))
    found = decode_odometry_pose(encode(message))
    assert found[0] == stamp
    np.testing.assert_array_equal(found[1], state["position_w"][0])
    np.testing.assert_array_equal(found[2], state["quaternion_wb"][0])


def test_few_ticks_are_encoded_to_the_same_bytes_as_many() -> None:
    ticks = _ticks(3 * FEW)
    parts = (state_messages(ticks[k : k + 3]).tobytes() for k in range(0, len(ticks), 3))
    assert b"".join(parts) == state_messages(ticks).tobytes()


def test_reference_imu_and_actuators_survive_exactly() -> None:
    ticks = _ticks(2)
    for i in range(2):
        stamp, reference = decode_external_reference(payloads_of(reference_messages(ticks))[i])
        assert stamp == ticks["imu"]["stamp_ns"][i]
        assert reference[0] == ticks["reference"][i]
        assert decode_imu(payloads_of(imu_messages(ticks))[i])[0] == ticks["imu"][i]
        sent = ticks["actuators"][i]
        message = decode(payloads_of(actuator_messages(ticks))[i], "quadlab_msgs/Actuators")
        torque = message.torque
        assert stamp_of(message) == ticks["imu"]["stamp_ns"][i]
        assert [message.thrust, torque.x, torque.y, torque.z] == sent["wrench"].tolist()
        for field in ("thrusts", "motor_references"):
            assert getattr(message, field).tolist() == sent[field].tolist()
        assert message.scaling == sent["scaling"]


def test_frames_follow_the_vehicle() -> None:
    payload = imu_messages(_ticks(1), "quad7").tobytes()
    assert decode(payload, "sensor_msgs/Imu").header.frame_id == "quad7/body"


def test_imu_says_that_it_has_no_orientation() -> None:
    message = decode(imu_messages(_ticks(1)).tobytes(), "sensor_msgs/Imu")
    assert message.orientation_covariance[0] == -1.0


def test_estimator_battery_and_pressure_carry_the_numbers_of_the_tick() -> None:
    ticks = _ticks(1)
    for name, number in zip(("used", "refused", "ignored"), (7, 5, 3), strict=True):
        ticks["estimate"][f"measurements_{name}"] = number
    ticks["estimate"]["agreement"] = 2
    ticks["estimate"]["nis"], ticks["estimate"]["nis_freedom"] = 7.5, 8
    told = ("consistency", "refused_share", "accelerometer_noise_scale")
    for number, name in enumerate(told, start=2):
        ticks["estimate"][name] = number
    for k, name in enumerate(("position", "velocity", "attitude")):
        ticks["estimate"][f"{name}_variance_w"] = (k + 1.0, k + 2.0, k + 3.0)
    estimate, status = ticks["estimate"][0], ticks["status"][0]
    message = decode(encode_estimators(ticks, "mine")[0], "quadlab_msgs/EstimatorStatus")
    assert message.estimator == "mine"
    assert message.mass == estimate["mass"]
    assert message.mass_variance == estimate["mass_variance"]
    assert message.measurement_age == estimate["measurement_age"]
    assert message.measurements_used == estimate["measurements_used"] == 7
    assert message.measurements_refused == estimate["measurements_refused"] == 5
    assert message.measurements_ignored == estimate["measurements_ignored"] == 3
    assert message.agreement == estimate["agreement"] == 2
    assert (message.nis, message.nis_freedom) == (7.5, 8)
    assert [getattr(message, name) for name in told] == [2.0, 3.0, 4.0]
    assert message.position_variance.x == 1.0
    assert message.velocity_variance.y == 3.0
    assert message.attitude_variance.z == 5.0
    assert message.gyroscope_bias.y == estimate["gyroscope_bias_b"][1]
    assert message.accelerometer_bias.z == estimate["accelerometer_bias_b"][2]
    assert message.position_innovation.x == estimate["position_innovation_w"][0]
    assert message.attitude_innovation.x == estimate["attitude_innovation_b"][0]
    battery = decode(encode_batteries(ticks)[0], "sensor_msgs/BatteryState")
    assert battery.voltage == pytest.approx(status["battery_voltage"])
    assert math.isnan(battery.percentage)
    pressure = decode(encode_pressures(ticks)[0], "sensor_msgs/FluidPressure")
    assert pressure.fluid_pressure == status["pressure"]


def test_status_carries_texts_and_statistics() -> None:
    ticks = _ticks(1)
    ticks["status"]["armed"] = 1
    ticks["status"]["parameter_revision"] = 7
    ticks["status"]["lateness_histogram"] = range(8)
    for number, name in enumerate(("overruns", "missed_frames", "damaged_frames"), start=1):
        ticks["status"][name] = number
    ticks["status"]["suspect_offset"], ticks["status"]["suspect_beacon"] = 0.07, -1
    ticks["status"]["suspect_left_out"] = 1
    payload = encode_status(ticks, "armed", "hover", ["link_degraded", "saturated"])
    message = decode(payload, "quadlab_msgs/VehicleStatus")
    assert (message.mode, message.behavior) == ("armed", "hover")
    assert message.flags == ["link_degraded", "saturated"]
    assert (message.armed, message.airborne, message.parameter_revision) == (True, False, 7)
    assert message.lateness_p99 == ticks["status"]["lateness_p99"][0]
    assert message.lateness_histogram.tolist() == list(range(8))
    assert (message.overruns, message.missed_frames, message.damaged_frames) == (1, 2, 3)
    assert (message.suspect_offset, message.suspect_beacon) == (0.07, -1)
    assert message.suspect_left_out


def test_a_status_without_flags_has_the_same_fields() -> None:
    ticks = _ticks(1)
    ticks["status"]["armed"] = 1
    plain = decode(encode_status(ticks, "ready", "take_off", []), "quadlab_msgs/VehicleStatus")
    flagged = decode(encode_status(ticks, "ready", "take_off", ["x"]), "quadlab_msgs/VehicleStatus")
    assert plain.flags == []
    for field in fields(plain):
        if field.name != "flags":
            one, other = getattr(plain, field.name), getattr(flagged, field.name)
            assert np.all(one == other), field.name


def test_events_and_parameter_changes() -> None:
    event = decode(encode_event(STAMP, 30, "link lost", "vehicle"), "rcl_interfaces/Log")
    assert (event.level, event.msg, stamp_of(event)) == (30, "link lost", STAMP)
    for old, value in ((3.0, 4.5), (1, 2), (False, True), ("1", "True")):
        change = ParameterChange(STAMP, "position.kp_xy", old, value, "anna", 12, 2**64 - 1)
        decoded = decode_change(encode_change(change))
        assert decoded == change
        assert type(decoded.new) is type(value)


def test_a_change_without_a_value_is_refused() -> None:
    with pytest.raises(LinkError, match="not set"):
        decode_change(encode(new("quadlab_msgs/ParameterChange", name="position.kp_xy")))


def _pose_samples() -> Record:
    samples = np.zeros(2, POSE_SAMPLE)
    samples["stamp_ns"] = STAMP, STAMP + 1
    samples["position_w"] = (1, 2, 3), (4, 5, 6)
    samples["quaternion_wb"] = (0.8, 0, 0.6, 0), (1, 0, 0, 0)
    return samples


def test_poses_survive() -> None:
    samples = _pose_samples()
    for sample, payload in zip(samples, payloads_of(pose_messages(samples)), strict=True):
        assert decode_pose(payload)[0] == sample


def test_pose_of_a_foreign_tracker_is_read_and_normalised() -> None:
    message = new(
        "geometry_msgs/PoseStamped",
        header=header(STAMP, "optitrack"),
        pose={"position": (1, 2, 3), "orientation": (0.0, 0.606, 0.0, 0.808)},
    )
    sample = decode_pose(encode(message))
    np.testing.assert_allclose(sample["quaternion_wb"][0], [0.8, 0.0, 0.6, 0.0], atol=1e-12)
    np.testing.assert_array_equal(sample["position_w"][0], [1.0, 2.0, 3.0])
    assert sample["stamp_ns"][0] == STAMP


@pytest.mark.parametrize(
    ("position", "quaternion"),
    [
        ((math.nan, 0, 0), (1, 0, 0, 0)),
        ((0, math.inf, 0), (1, 0, 0, 0)),
        ((0, 0, 0), (0, 0, 0, 0)),
        ((0, 0, 0), (math.nan, 0, 0, 0)),
        ((0, 0, 0), (1, 1, 0, 0)),
    ],
)
def test_a_pose_the_estimator_could_not_use_is_refused(
    position: tuple[float, ...], quaternion: tuple[float, ...]
) -> None:
    samples = _pose_samples()[:1]
    samples["position_w"], samples["quaternion_wb"] = position, quaternion
    with pytest.raises(MeasurementError, match="finite numbers and a unit quaternion"):
        decode_pose(pose_messages(samples).tobytes())


def test_positions_of_a_marker_survive_and_bad_ones_are_refused() -> None:
    samples = _pose_samples()
    samples["quaternion_wb"] = NO_ATTITUDE
    for sample, payload in zip(samples, payloads_of(position_messages(samples)), strict=True):
        assert decode_position(payload)[0] == sample
    samples["position_w"][0, 1] = math.nan
    with pytest.raises(MeasurementError, match="nan"):
        decode_position(position_messages(samples[:1]).tobytes())


def test_bearing_pose_keeps_covariance() -> None:
    covariance = np.arange(36.0).reshape(6, 6)
    payload = encode_bearing_pose(
        STAMP, np.array([1.0, 2, 3]), np.array([0.8, 0, 0.6, 0]), covariance
    )
    message = decode(payload, "geometry_msgs/PoseWithCovarianceStamped")
    np.testing.assert_array_equal(message.pose.covariance, covariance.ravel())
    assert (message.pose.pose.orientation.w, message.pose.pose.orientation.y) == (0.8, 0.6)


def test_bearings_survive_and_bad_ones_are_refused() -> None:
    bearings = [(1.0, 0.0, 0.0), (0.0, 0.6, -0.8)]
    back = decode_bearings(encode_bearings(STAMP, [3, 1], bearings, 0.026))
    assert (back["stamp_ns"][0], beacon_ids_of(back), back["sigma"][0]) == (STAMP, [3, 1], 0.026)
    np.testing.assert_array_equal(back["bearing_b"][0, :2], bearings)
    with pytest.raises(MeasurementError, match="2 bearings with 1 beacon"):
        decode_bearings(encode_bearings(STAMP, [3], bearings, 0.026))
    with pytest.raises(MeasurementError, match="finite unit vectors"):
        decode_bearings(encode_bearings(STAMP, [3], [(1.0, 1.0, 0.0)], 0.026))
    with pytest.raises(MeasurementError, match="finite unit vectors"):
        decode_bearings(encode_bearings(STAMP, [3], [(math.nan, 1.0, 0.0)], 0.026))
    with pytest.raises(MeasurementError, match="sigma"):
        decode_bearings(encode_bearings(STAMP, [3, 1], bearings, 0.0))


def test_sticks_survive_are_cut_and_bad_ones_are_refused() -> None:
    back = decode_joy(encode_joy(STAMP, (0.5, -0.25, 3.0, -1.0), True))
    assert back.axes == (0.5, -0.25, 1.0, -1.0)
    assert back.enabled
    assert back.stamp_ns == STAMP
    assert not decode_joy(encode_joy(STAMP, (0, 0, 0, 0), False)).enabled
    with pytest.raises(MeasurementError, match="four finite axes"):
        decode_joy(encode_joy(STAMP, (math.nan, 0, 0, 0), True))
    with pytest.raises(MeasurementError, match="four finite axes"):
        decode_joy(encode(new("sensor_msgs/Joy", axes=[0.0, 0.0], buttons=[1])))
    with pytest.raises(MeasurementError, match="button 0"):
        decode_joy(encode(new("sensor_msgs/Joy", axes=[0.0] * 4)))


def test_heartbeat_survives() -> None:
    assert decode_heartbeat(encode_heartbeat(9, STAMP)) == (9, STAMP, 0, 0)
    assert decode_heartbeat(encode_heartbeat(9, STAMP, 2**64 - 1, 7)) == (9, STAMP, 2**64 - 1, 7)


def test_garbage_is_a_link_error() -> None:
    for decoder in (decode_odometry, decode_pose, decode_joy, decode_bearings, decode_heartbeat):
        with pytest.raises(LinkError):
            decoder(b"\x00\x01\x00\x00garbage")


def test_every_topic_and_service_has_a_known_type() -> None:
    for topic in TOPICS.values():
        assert stored_name(topic.type_name) in TYPESTORE.types
    for srv_type in SERVICES.values():
        assert stored_name(f"{srv_type}_Request") in TYPESTORE.types
