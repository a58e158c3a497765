"""The table of topics: the type of each, who sends it, how often, and how it may travel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from vehicle_link.transport.rmw_keys import RELIABLE, SENSOR_DATA, Qos

Sender = Literal["vehicle", "station", "simulator", "web"]
Priority = Literal["real_time", "interactive_high", "data_high", "data", "background"]


@dataclass(frozen=True, slots=True)
class Topic:
    """One row; the name is relative to the vehicle's namespace (`/quad1`)."""

    name: str
    type_name: str
    sender: Sender
    rate: float  # Hz; 0 = on change
    qos: Qos = SENSOR_DATA
    priority: Priority = "data"
    express: bool = False  # not batched with what follows
    drop: bool = True  # on congestion; False waits


_ROWS = (
    # On the radio, from the vehicle.
    Topic(
        "telemetry", "quadlab_msgs/Telemetry", "vehicle", 100, priority="real_time", express=True
    ),
    Topic("status", "quadlab_msgs/VehicleStatus", "vehicle", 10, priority="interactive_high"),
    Topic("estimator", "quadlab_msgs/EstimatorStatus", "vehicle", 50),
    Topic("battery", "sensor_msgs/BatteryState", "vehicle", 2),
    Topic("pressure", "sensor_msgs/FluidPressure", "vehicle", 25),
    Topic("bearing_pose", "geometry_msgs/PoseWithCovarianceStamped", "vehicle", 30),
    Topic("parameter_events", "rcl_interfaces/ParameterEvent", "vehicle", 0, RELIABLE, drop=False),
    Topic("parameter_changes", "quadlab_msgs/ParameterChange", "vehicle", 0, RELIABLE, drop=False),
    Topic("events", "rcl_interfaces/Log", "vehicle", 0, RELIABLE, drop=False),
    Topic(
        "vehicle_heartbeat",
        "quadlab_msgs/Heartbeat",
        "vehicle",
        20,
        priority="real_time",
        express=True,
    ),
    # On the radio, from the station; stamps are of the vehicle's clock.
    Topic(
        "tracker_pose",
        "geometry_msgs/PoseStamped",
        "station",
        100,
        priority="real_time",
        express=True,
    ),
    Topic(
        "bearings", "quadlab_msgs/BearingArray", "station", 30, priority="real_time", express=True
    ),
    Topic("joy", "sensor_msgs/Joy", "station", 50, priority="real_time", express=True),
    Topic(  # from ROS 2 nodes alone, as often as they like
        "external_reference",
        "quadlab_msgs/Reference",
        "station",
        0,
        priority="real_time",
        express=True,
    ),
    Topic(
        "station_heartbeat",
        "quadlab_msgs/Heartbeat",
        "station",
        20,
        priority="real_time",
        express=True,
    ),
    # On loopback: telemetry expanded, and what the station knows.
    Topic("state", "nav_msgs/Odometry", "station", 100),
    Topic("reference", "quadlab_msgs/Reference", "station", 100),
    Topic("imu", "sensor_msgs/Imu", "station", 100),
    Topic("actuators", "quadlab_msgs/Actuators", "station", 100),
    Topic("station_status", "quadlab_msgs/StationStatus", "station", 5),
    Topic("link_status", "quadlab_msgs/LinkStatus", "station", 5),
    Topic("comparison", "quadlab_msgs/EstimatorComparison", "station", 10),
    Topic("experiment_status", "quadlab_msgs/ExperimentStatus", "station", 1),  # 5 while one runs
    Topic("preflight", "quadlab_msgs/Preflight", "station", 2),
    Topic("control", "quadlab_msgs/ControlStatus", "station", 2),
    Topic("transfers", "quadlab_msgs/Transfers", "station", 2),
    Topic("marks", "quadlab_msgs/Mark", "station", 0, RELIABLE, drop=False),
    Topic("presence", "quadlab_msgs/Presence", "web", 1),
    Topic("truth", "nav_msgs/Odometry", "simulator", 100),
    Topic("bench_reading", "quadlab_msgs/BenchReading", "simulator", 200),
    Topic("stick", "sensor_msgs/Joy", "web", 50),
    Topic("stick_status", "quadlab_msgs/StickStatus", "station", 50),
)

TOPICS: dict[str, Topic] = {topic.name: topic for topic in _ROWS}
"""By name."""

SHARED = ("events", "parameter_changes", "parameter_events")
"""The station sends these too, with stamps of its own; recorded where they are received."""

SERVICES: dict[str, str] = {
    "arm": "quadlab_msgs/srv/Command",
    "disarm": "quadlab_msgs/srv/Command",
    "start_behavior": "quadlab_msgs/srv/StartBehavior",
    "emergency": "quadlab_msgs/srv/Emergency",
    "change_parameters": "quadlab_msgs/srv/ChangeParameters",
    "time_sync": "quadlab_msgs/srv/TimeSync",
    "whoami": "quadlab_msgs/srv/WhoAmI",
    "record": "quadlab_msgs/srv/Record",
    "mark": "quadlab_msgs/srv/Mark",
    "experiment": "quadlab_msgs/srv/Experiment",
    "lane": "quadlab_msgs/srv/Lane",
    "onboard_log": "quadlab_msgs/srv/OnboardLog",
    "onboard_files": "quadlab_msgs/srv/OnboardFiles",
    "onboard_part": "quadlab_msgs/srv/OnboardPart",
    "onboard_index": "quadlab_msgs/srv/OnboardIndex",
    "transfer": "quadlab_msgs/srv/Transfer",
    "checks": "quadlab_msgs/srv/Checks",
    "control": "quadlab_msgs/srv/Control",
    "simulation": "quadlab_msgs/srv/Simulation",
    "calibrate": "quadlab_msgs/srv/Calibrate",
    "bench": "quadlab_msgs/srv/Bench",
}
"""Type of each service by name: the vehicle's `/quad1/<name>`, the station's
`/quad1/station/<name>`. The station alone has `record`, `mark`, `experiment`, `control` and
`transfer`, and hands `onboard_files` and `onboard_log` on to the vehicle, `simulation` to the
simulator's `/quad1/simulator/simulation`; the vehicle alone has `time_sync`,
`whoami`, `lane`, `calibrate`, `bench` and the rest about the files of its log."""
