"""The declaration of the extension `identification`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Experiment,
    Extension,
    Group,
    Judged,
    ReportFigures,
)

EXTENSION = Extension(
    name="identification",
    summary="Drag, noise of the inertial sensors, delay and body of the tracker, as experiments; "
    "forces that the model leaves unexplained, from recorded flights",
    protocol=1,
    offers=(
        Experiment(
            name="inertia_optimal",
            target=".optimal_inertia.experiment:OptimalInertia",
            calibration="inertia",
        ),
        Experiment(name="drag", target=".drag.experiment:DragExperiment", calibration="drag"),
        Experiment(name="drag_optimal", target=".drag.optimal:OptimalDrag", calibration="drag"),
        Experiment(
            name="vibration",
            target=".vibration.experiment:VibrationExperiment",
            calibration="vibration",
        ),
        Experiment(
            name="tracker_delay",
            target=".tracked_body.experiment:TrackerDelay",
            calibration="tracker_delay",
        ),
        Experiment(
            name="tracker_body",
            target=".tracked_body.experiment:TrackerBody",
            calibration="tracker_body",
        ),
        ReportFigures(name="vibration", target=".vibration.figures:vibration"),
        Command(
            name="identify",
            target=".residual.command:Identify",
            group=Group.RECORDED,
            summary="Fit drag by axis, its height and the loss of thrust to the forces that "
            "the model does not explain in recorded flights.",
            examples={"quadlab identify residual LOG LOG": "propose values, judged by each flight"},
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights whose truth is known"),),
    docs="calibration.md",
)
