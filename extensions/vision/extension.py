"""The declaration of the extension `vision`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Extension,
    Group,
    Judged,
    PageFeature,
    PagePanel,
    SimulatedSensor,
    TrackingSystem,
)

OPTIONS = ".options:CameraOptions"
EXTENSION = Extension(
    name="vision",
    summary="Cameras: poses of tagged bodies, bearings to tags and LEDs on board, calibration",
    protocol=1,
    offers=(
        TrackingSystem(name="camera", target=".systems:OutsideCameras", options=OPTIONS),
        TrackingSystem(
            name="onboard_camera", target=".systems:OnboardCamera", options=OPTIONS, bearings=True
        ),
        SimulatedSensor(
            name="camera",
            target=".simulated.onboard_camera:make",
            parameters=".simulated.parameters:CameraParameters",
        ),
        SimulatedSensor(
            name="outside_cameras",
            target=".simulated.outside_cameras:make",
            parameters=".simulated.parameters:OutsideCameraParameters",
        ),
        Command(
            name="camera",
            target=".command:Camera",
            group=Group.SET_UP,
            summary="Calibrate a camera with a ChArUco board (DICT_4X4_250), which is moved as the "
            "lines say.",
            examples={
                "quadlab camera --paper board.pdf": "write the board, to be printed at 100 %",
                "quadlab camera --device 0": "calibrate a camera with that board",
                "quadlab camera --board 9x6 --square 0.04 --marker 0.03": "… with another board",
            },
        ),
        PageFeature(name="camera", target=".calibration.routes:FEATURE"),
        PagePanel(
            name="camera",
            target="page/camera.js:show",
            place="settings",
            title="Camera",
            styles=("calibration.css",),
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "rendered pictures with noise, blur and a real lens"),),
    docs="how_to/camera.md",
)
