"""Examples of each command, printed below the options by `--help`."""

from __future__ import annotations

EXAMPLES: dict[str, dict[str, str]] = {
    "up": {
        "quadlab up": "fly a simulated vehicle under the page",
        "quadlab up --set simulator.preset=rough": "… as rough as a real one",
        "quadlab up --tracker natnet": "… on the poses of a simulated OptiTrack",
    },
    "fly": {
        "quadlab fly figure_eight --report": "fly the paper's 8, and make a report of it",
        "quadlab fly bearings --seed 3 --out flights": "fly on bearings, log into flights/",
        "quadlab fly hover --set control.preset=stiff": "fly with other gains",
        'quadlab fly hover --set faults="motors.fade from=12 ramp=3"': "with a motor that fades",
    },
    "calibrate": {
        "quadlab calibrate": "print the calibrations in force",
        "quadlab calibrate accelerometer": "calibrate, guided step by step",
        "quadlab calibrate gyroscope --accept": "calibrate in a script",
    },
    "log": {
        "quadlab log info --explain LOG": "print what happened in a flight",
        "quadlab log import FLIGHT.ulg": "import a flight that PX4 recorded",
        "quadlab log export LOG --format parquet": "convert a log for pandas",
    },
    "replay": {
        "quadlab replay LOG": "run both estimators over a recorded flight",
        "quadlab replay LOG --on bearings --estimator error_state": "run one, on bearings",
        "quadlab replay LOG --run error_state --run 'complementary bearings.sigma=3'": (
            "compare two, with settings of their own"
        ),
    },
    "link": {
        "quadlab link enrol quad1 192.168.1.20": "create the certificates of a vehicle",
        "quadlab link list --seek": "list known vehicles, and others on this network",
        "quadlab link test quad1": "measure latency, loss and throughput",
    },
    "user": {
        "quadlab user add anna": "add an account; asks for the password",
        "quadlab user role anna operator": "change what an account may do",
    },
    "camera": {
        "quadlab camera --paper board.pdf": "write the board, to be printed at 100 %",
        "quadlab camera --device 0": "calibrate a camera with that board",
        "quadlab camera --board 9x6 --square 0.04 --marker 0.03": "… with another board",
    },
    "gains": {
        "quadlab gains": "print the margins of the named gain sets",
        "quadlab gains --set control.position.kp_xy=5": "… and of one that differs",
    },
    "new": {
        "quadlab new law mine": "write a control law and its test into the data folder",
        "quadlab new estimator mine": "write an estimator and its test",
        "quadlab new behavior mine": "write a behavior and its test",
    },
    "export": {
        "quadlab export fmu plant --out plant.fmu": "write the simulated vehicle as an FMU",
        "quadlab export fmu law --out mine.fmu --set control.preset=stiff": "… or the law",
    },
    "doctor": {"quadlab doctor": "print what a maintainer asks for"},
    "vehicle": {
        "quadlab vehicle --find": "list the serial devices, and what answers there",
        "quadlab vehicle --check --serial auto": "check the board without propellers",
        "quadlab vehicle --serial auto --rate 500": "fly",
        "quadlab vehicle --board betaflight --serial /dev/ttyACM0 --check": "check its settings",
        "quadlab vehicle --board crazyflie --serial radio://0/80/2M/E7E7E7E7E7 --check": "the same",
    },
    "simulator": {"quadlab simulator --folder quad": "simulate a vehicle behind quad/mcu0"},
    "station": {"quadlab station --vehicle quad1": "run the station of one vehicle"},
    "mavlink": {
        "quadlab mavlink": "fly with QGroundControl or MAVSDK on this computer",
        "quadlab mavlink udpin:127.0.0.1:14550 --viewers": "listen, and send telemetry only",
        "quadlab mavlink tcpin:127.0.0.1:5760 --passphrase words.txt": "fly with signed messages",
    },
    "tracker": {
        "quadlab tracker natnet --host 192.168.1.5 --body quad1=cf7": "track with OptiTrack",
        "quadlab tracker camera --device 0 --intrinsics camera.yaml --tags tags.toml": (
            "track with a USB camera"
        ),
        "quadlab tracker camera --device 0 1 --intrinsics a.yaml b.yaml --tags tags.toml": (
            "track with two"
        ),
    },
    "crazyradio": {
        "quadlab crazyradio radio://0/80/2M/E7E7E7E701=19850 radio://0/80/2M/E7E7E7E702=19851": (
            "share one radio between two Crazyflies"
        )
    },
    "web": {"quadlab web --port 8080": "serve the page of a running station"},
}


def examples_of(command: str) -> str:
    """Return what `quadlab COMMAND --help` prints below the options."""
    shown = EXAMPLES.get(command, {})
    width = max(map(len, shown), default=0)
    lines = [f"  {words:{width}}  {what}" for words, what in shown.items()]
    return "\n".join(["Examples:", *lines, ""]) if lines else ""
