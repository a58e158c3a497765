"""The declaration of the extension `offline`."""

from quadrotor.extension import Command, Evidence, Extension, Function, Group, Judged, LayoutSurvey

EXTENSION = Extension(
    name="offline",
    summary="Estimators run again over recorded flights, and surveys of the beacons",
    protocol=1,
    offers=(
        Function(name="replayed", target=".figures:replayed"),
        Command(
            name="replay",
            group=Group.RECORDED,
            summary="Run estimators over the IMU, measurements and truth of a recorded flight, and "
            "compare them.",
            target=".command:Replay",
            examples={
                "quadlab replay LOG": "run both estimators over a recorded flight",
                "quadlab replay LOG --on bearings --estimator error_state": "run one, on bearings",
                "quadlab replay LOG --run error_state --run 'complementary bearings.sigma=3'": (
                    "compare two, with settings of their own"
                ),
            },
        ),
        LayoutSurvey(name="survey", target=".proposal:propose_layout"),
    ),
    judged=(Judged(Evidence.PEER, "recorded flights of others, which docs/importing.md names"),),
    docs="replay.md",
)
