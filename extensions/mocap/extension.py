"""The declaration of the extension `mocap`."""

from quadrotor.extension import Evidence, Extension, Judged, ServedSystem, TrackingSystem

LIBRARY = "motioncapture"
EXTENSION = Extension(
    name="mocap",
    summary="Vicon, OptiTrack, Qualisys, VRPN, ROS 2 and UDP as tracking systems",
    protocol=1,
    offers=(
        TrackingSystem(name="vicon", target=".clients:VICON", port=801, library=LIBRARY),
        TrackingSystem(name="natnet", target=".clients:NATNET", port=1510, library=LIBRARY),
        TrackingSystem(name="qtm", target=".clients:QTM", port=22222, library=LIBRARY),
        TrackingSystem(name="vrpn", target=".clients:VRPN", port=3883, library=LIBRARY),
        TrackingSystem(name="ros2", target=".ros2:SYSTEM"),
        TrackingSystem(name="udp", target=".udp:SYSTEM", port=5005),
        ServedSystem(name="vrpn", target=".served_vrpn:VrpnServer", port=3883),
        ServedSystem(name="natnet", target=".served_natnet:NatNetServer", port=1510),
        ServedSystem(name="qtm", target=".served_qtm:QtmServer", port=22222),
    ),
    judged=(
        Judged(Evidence.PEER, "motioncapture 1.1, natnet 0.3 and qtm-rt 3.1 on the served poses"),
        Judged(Evidence.SIMULATED, "vicon: the client alone"),
    ),
    libraries={LIBRARY: "`scripts/setup trackers` or `pip install 'quadlab[trackers]'`"},
    docs="trackers.md",
)
