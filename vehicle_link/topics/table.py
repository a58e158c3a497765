"""The table of topics: the type of each, its sender, its rate, and how it may be transported."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, cast

from quadrotor.records import OWN_SENSORS
from vehicle_link.commands import COMMANDS
from vehicle_link.topics.rmw_keys import RELIABLE, SENSOR_DATA, Qos

if TYPE_CHECKING:
    from vehicle_link.topics.typed_tables import Services, Topics

Sender = Literal["vehicle", "station", "simulator", "tracker", "web"]
Priority = Literal["real_time", "interactive_high", "data_high", "data", "background"]


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the table; the name is relative to the vehicle's namespace (`/quad1`) unless it
    has a leading slash.
    """

    name: str
    type_name: str
    sender: Sender
    rate: float  # Hz; 0 = on change
    priority: Priority = "data"
    qos: Qos = SENSOR_DATA
    lane: int = 0  # its number in datagrams of the lane; 0: it has none
    one_source: bool = False  # the vehicle follows one sender at a time
    recorded: bool = False  # by the station: its own as sent, others as received
    newest: int = 0  # most that may wait at the station, as late ones are worthless; 0: all
    stale: float = 0.0  # s until the page greys its values out; 0: the page keeps none
    page: Literal["always", "seen", "chart"] = "always"  # when the page subscribes
    kept: int = 0  # messages that its sender keeps for subscribers that missed some

    @property
    def on_radio(self) -> bool:
        """Return whether it crosses the radio; other topics stay on the station's loopback."""
        return self.sender == "vehicle" or self.one_source or self.lane > 0

    @property
    def express(self) -> bool:
        """Return whether the message is sent at once instead of batched with later messages."""
        return self.priority == "real_time"


TRACKER_PICTURES = ("tracker_picture", *(f"tracker_{k}_picture" for k in (2, 3, 4)))
"""The pictures of up to four cameras of one tracker, in the order of its command."""

_ROWS = (
    # On loopback: expanded telemetry; in the first rows because the page lists them first.
    Topic("state", "nav_msgs/Odometry", "station", 100, stale=0.3, page="seen"),
    Topic("reference", "quadlab_msgs/Reference", "station", 100, stale=0.3, page="seen"),
    Topic("actuators", "quadlab_msgs/Actuators", "station", 100, stale=0.3, page="seen"),
    Topic("imu", "sensor_msgs/Imu", "station", 100, stale=0.3, page="chart"),
    # On loopback: telemetry as it arrived, with every tick; source stamp 0 where it is not current.
    # The class with the longest queue: with a shorter one, a busy computer drops some.
    Topic("ticks", "quadlab_msgs/Telemetry", "station", 100, "background", kept=12_000),
    # For 3D panels; recorded with the telemetry that they are made of.
    Topic("/tf", "tf2_msgs/TFMessage", "station", 50),
    Topic("/tf_static", "tf2_msgs/TFMessage", "station", 1),
    Topic("scene", "visualization_msgs/MarkerArray", "station", 2),
    # On the radio, from the vehicle.
    Topic("telemetry", "quadlab_msgs/Telemetry", "vehicle", 100, "real_time", lane=1),
    Topic(
        "status",
        "quadlab_msgs/VehicleStatus",
        "vehicle",
        10,
        "interactive_high",
        recorded=True,
        stale=1.0,
    ),
    Topic(
        "estimator",
        "quadlab_msgs/EstimatorStatus",
        "vehicle",
        50,
        recorded=True,
        stale=0.3,
        page="seen",
    ),
    Topic("battery", "sensor_msgs/BatteryState", "vehicle", 2, recorded=True, stale=3.0),
    Topic(
        "pressure",
        "sensor_msgs/FluidPressure",
        "vehicle",
        25,
        recorded=True,
        stale=0.5,
        page="chart",
    ),
    Topic(
        "bearing_pose",
        "geometry_msgs/PoseWithCovarianceStamped",
        "vehicle",
        30,
        recorded=True,
        stale=0.3,
        page="seen",
    ),
    *(  # readings of sensors of the user's own: all in the vehicle's log, fewer by radio
        Topic(
            f"sensor_{place}",
            "quadlab_msgs/SensorReading",
            "vehicle",
            50,
            recorded=True,
            stale=1.0,
            page="chart",
        )
        for place in range(1, OWN_SENSORS + 1)
    ),
    Topic(
        "parameter_changes",
        "quadlab_msgs/ParameterChange",
        "vehicle",
        0,
        qos=RELIABLE,
        recorded=True,
    ),
    Topic("events", "rcl_interfaces/Log", "vehicle", 0, qos=RELIABLE, recorded=True),
    Topic("vehicle_heartbeat", "quadlab_msgs/Heartbeat", "vehicle", 20, "real_time", lane=2),
    # On the radio, from the station; stamps are on the vehicle's clock.
    Topic(
        "tracker_pose",
        "geometry_msgs/PoseStamped",
        "station",
        100,
        "real_time",
        lane=3,
        one_source=True,
        recorded=True,
        stale=0.3,
        page="chart",
    ),
    Topic(  # of a single marker, instead of poses
        "tracker_position",
        "geometry_msgs/PointStamped",
        "station",
        100,
        "real_time",
        lane=7,
        one_source=True,
        recorded=True,
        stale=0.3,
        page="chart",
    ),
    Topic(
        "bearings",
        "quadlab_msgs/BearingArray",
        "station",
        30,
        "real_time",
        lane=4,
        one_source=True,
        recorded=True,
        stale=0.5,
        page="seen",
    ),
    Topic(
        "joy",
        "sensor_msgs/Joy",
        "station",
        50,
        "real_time",
        lane=5,
        one_source=True,
        recorded=True,
        stale=0.3,
        page="chart",
    ),
    Topic(  # only from ROS 2 nodes, at any rate
        "external_reference", "quadlab_msgs/Reference", "station", 0, "real_time", one_source=True
    ),
    Topic("station_heartbeat", "quadlab_msgs/Heartbeat", "station", 20, "real_time", lane=6),
    # On loopback: what the station reports.
    Topic("station_status", "quadlab_msgs/StationStatus", "station", 5, recorded=True, stale=1.5),
    Topic("link_status", "quadlab_msgs/LinkStatus", "station", 5, recorded=True, stale=1.5),
    Topic(
        "comparison",
        "quadlab_msgs/EstimatorComparison",
        "station",
        10,
        recorded=True,
        stale=0.5,
        page="seen",
    ),
    Topic(
        "experiment_status", "quadlab_msgs/ExperimentStatus", "station", 1, recorded=True, stale=2.5
    ),  # 5 while one runs
    Topic("preflight", "quadlab_msgs/Preflight", "station", 2, recorded=True, stale=2.0),
    Topic("control", "quadlab_msgs/ControlStatus", "station", 2, recorded=True, stale=2.0),
    Topic("transfers", "quadlab_msgs/Transfers", "station", 2, stale=3.0),
    Topic("marks", "quadlab_msgs/Mark", "station", 0, qos=RELIABLE),
    Topic("presence", "quadlab_msgs/Presence", "web", 1),
    Topic(  # to other vehicles, emulated for a formation that is flown from the page
        "neighbour_bearings", "quadlab_msgs/BearingArray", "web", 30, recorded=True, newest=50
    ),
    Topic(
        "truth",
        "nav_msgs/Odometry",
        "simulator",
        100,
        recorded=True,
        newest=50,
        stale=0.3,
        page="seen",
        kept=12_000,
    ),
    Topic(
        "bench_reading",
        "quadlab_msgs/BenchReading",
        "simulator",
        200,
        recorded=True,
        stale=0.3,
        page="seen",
    ),
    # From the tracker process; stamps are on the station's clock.
    Topic("tracker_body", "geometry_msgs/PoseStamped", "tracker", 100, "real_time", newest=50),
    Topic("tracker_status", "quadlab_msgs/TrackerStatus", "tracker", 10, recorded=True, stale=1.5),
    # Pictures for people, with tags marked: made only while someone watches or records.
    *(
        Topic(name, "sensor_msgs/CompressedImage", "tracker", 10, newest=2)
        for name in TRACKER_PICTURES
    ),
    # From the process of a camera on the vehicle; stamps as above.
    Topic("camera_bearings", "quadlab_msgs/BearingArray", "tracker", 30, "real_time", newest=50),
    Topic("camera_status", "quadlab_msgs/TrackerStatus", "tracker", 10, recorded=True, stale=1.5),
    Topic("camera_picture", "sensor_msgs/CompressedImage", "tracker", 10, newest=2),
    # Only in imported flights: Lighthouse base stations.
    Topic("sweeps", "quadlab_msgs/SweepArray", "simulator", 120),
    Topic("stick", "sensor_msgs/Joy", "web", 50),
    Topic("stick_status", "quadlab_msgs/StickStatus", "station", 50),
)

TOPICS = cast("Topics", {topic.name: topic for topic in _ROWS})
"""Topics by name."""

SHARED = ("events", "parameter_changes")
"""Topics that the station sends too, with its own stamps; recorded where they are received."""

_SERVICES = {
    **{name: command.service for name, command in COMMANDS.items()},
    "time_sync": "quadlab_msgs/srv/TimeSync",
    "whoami": "quadlab_msgs/srv/WhoAmI",
    "mark": "quadlab_msgs/srv/Mark",
    "experiment": "quadlab_msgs/srv/Experiment",
    "lane": "quadlab_msgs/srv/Lane",
    "onboard_log": "quadlab_msgs/srv/OnboardLog",
    "onboard_files": "quadlab_msgs/srv/OnboardFiles",
    "onboard_part": "quadlab_msgs/srv/OnboardPart",
    "transfer": "quadlab_msgs/srv/Transfer",
    "checks": "quadlab_msgs/srv/Checks",
    "control": "quadlab_msgs/srv/Control",
    "calibrate": "quadlab_msgs/srv/Calibrate",
}
SERVICES = cast("Services", _SERVICES)
"""Type of each service by name: the vehicle's `/quad1/<name>`, the station's
`/quad1/station/<name>`. Of those that are not commands only the station has `mark`, `experiment`,
`control` and `transfer`, and it forwards `onboard_files` and `onboard_log` to the vehicle; only
the vehicle has `time_sync`, `whoami`, `lane`, `calibrate` and the other services for the files of
its log."""
