"""Reference figures: those of the paper, and those of an independent simulation of its vehicle.

The simulation is the one of docs/robustness.md: full sensors (tracker at 100 Hz with 1 mm and 0.2°,
noisy quantised IMU, whole motor references), written without this project's code.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

PAPER = "paper"
SIMULATION = "independent simulation"
FRAME = "reasonable for the frame"


@dataclass(frozen=True)
class ReferenceFigure:
    """One reference figure.

    Attributes:
        what: the quantity and the conditions.
        value: the value as text with its unit.
        source: where the figure comes from.
        metric: name of the run's own figure to show next to it; empty when there is none.
        when: options with which the two may be compared.
    """

    what: str
    value: str
    source: str
    metric: str = ""
    when: tuple[tuple[str, str], ...] = ()

    def fits(self, options: Mapping[str, object]) -> bool:
        """Return whether a run with these options may be compared with it."""
        return bool(self.metric) and all(str(options.get(k)) == value for k, value in self.when)


LAPS = ("laps", "steady")
HOVER, EIGHT = ("manoeuvre", "hover"), ("manoeuvre", "figure_eight")
FILTER = ("estimator", "complementary")
AUTO, PRINTED = ("gains", "auto"), ("gains", "paper")
FIGURES: dict[str, tuple[ReferenceFigure, ...]] = {
    "hover": (
        ReferenceFigure("motor reference in hover", "127 counts", SIMULATION, "motor_mean_counts"),
        ReferenceFigure("thrust of a motor in hover", "3.21 N", SIMULATION),
    ),
    "figure_eight": (
        ReferenceFigure("position rms, true state", "1.1 mm", SIMULATION),
        ReferenceFigure(
            "position rms, full sensors", "3.0 mm", SIMULATION, "position_rms_m", (LAPS,)
        ),
        ReferenceFigure("largest, full sensors", "5.6 mm", SIMULATION, "position_max_m", (LAPS,)),
        ReferenceFigure("yaw rms, full sensors", "0.23°", SIMULATION, "yaw_rms_deg", (LAPS,)),
        ReferenceFigure("position rms without feed-forward", "42 mm", SIMULATION),
        ReferenceFigure("position rms, mass wrong by 0.3 kg", "158 mm", SIMULATION),
        ReferenceFigure(
            "rest to rest in one lap, yaw ± 0.2 rad",
            "17 mm rms",
            SIMULATION,
            "position_rms_m",
            (("laps", "rest_to_rest"), ("yaw_amplitude", "0.2")),
        ),
        ReferenceFigure("tilt, rest to rest in one lap", "37°", SIMULATION),
    ),
    "bearings": (
        ReferenceFigure(
            "hover, complementary filter retuned",
            "43 mm rms",
            SIMULATION,
            "position_rms_m",
            (HOVER, FILTER, AUTO),
        ),
        ReferenceFigure(
            "the 8, complementary filter retuned",
            "48 … 60 mm rms",
            SIMULATION,
            "position_rms_m",
            (EIGHT, FILTER, AUTO),
        ),
        ReferenceFigure(
            "hover, gains as printed",
            "0.14 m rms",
            SIMULATION,
            "position_rms_m",
            (HOVER, FILTER, PRINTED),
        ),
        ReferenceFigure(
            "the 8, gains as printed",
            "0.53 … 0.59 m rms",
            SIMULATION,
            "position_rms_m",
            (EIGHT, FILTER, PRINTED),
        ),
        ReferenceFigure(
            "estimate, posterior bound at 0.75 m/s",
            "11.8 mm, 13.0 mm/s, 0.092°",
            "bound of the sensors, " + SIMULATION,
        ),
        ReferenceFigure(
            "estimate of position, error-state filter",
            "12.1 mm",
            SIMULATION,
            "estimate_position_rms_m",
            (("estimator", "error_state"),),
        ),
        ReferenceFigure(
            "estimate of velocity, error-state filter",
            "13.0 mm/s",
            SIMULATION,
            "estimate_velocity_rms_m_s",
            (("estimator", "error_state"),),
        ),
        ReferenceFigure(
            "estimate of attitude, error-state filter",
            "0.090°",
            SIMULATION,
            "estimate_attitude_rms_deg",
            (("estimator", "error_state"),),
        ),
    ),
    "mass": (
        ReferenceFigure("mass of the vehicle", "1.308 kg", PAPER + ", Sec. 7"),
        ReferenceFigure("mass estimated in the paper's flight", "1.394 kg", PAPER + ", Sec. 7"),
        ReferenceFigure("the same with a thrust efficiency of 0.938", "1.394 kg", SIMULATION),
        ReferenceFigure("true state", "1.308 ± 0.001 kg", SIMULATION),
        ReferenceFigure("full sensors", "1.317 kg", SIMULATION, "mass_kg"),
        ReferenceFigure(
            "within 1 % after lift-off, gated by airborne",
            "1.2 s",
            SIMULATION,
            "within_1_percent_s",
        ),
        ReferenceFigure(
            "lift-off with 1.0 kg believed",
            "4.5 s of 0.1 m/s climb",
            SIMULATION,
            "lift_off_s",
            (("initial", "1.0"), ("climb", "0.1")),
        ),
    ),
    "motor_bench": (
        ReferenceFigure("force at 30 counts", "0.3131 N", PAPER + ", Sec. 5.3", "thrust_min_N"),
        ReferenceFigure("force at 180 counts", "6.03 N", PAPER + ", Sec. 5.3", "thrust_max_N"),
        ReferenceFigure(
            "torque over force", "0.0174 m", PAPER + ", Sec. 5.3", "model.torque_ratio"
        ),
        ReferenceFigure(
            "time constant of the speed", "0.047 s", PAPER + ", Sec. 5.3", "time_constant_s"
        ),
        ReferenceFigure("time constant when it is taken from force", "0.059 … 0.065 s", SIMULATION),
        ReferenceFigure(
            "worst miss of the affine root law", "0.06 counts", SIMULATION, "root_law_worst_count"
        ),
        ReferenceFigure(
            "worst miss of a quadratic in force", "5.9 counts", SIMULATION, "quadratic_worst_count"
        ),
    ),
    "inertia": (
        ReferenceFigure("about x (not printed)", "0.0154 kg m²", FRAME, "inertia_xx_kg_m2"),
        ReferenceFigure("about y (not printed)", "0.0154 kg m²", FRAME, "inertia_yy_kg_m2"),
        ReferenceFigure("about z (not printed)", "0.0250 kg m²", FRAME, "inertia_zz_kg_m2"),
        ReferenceFigure("bias when the motors' lag is left out", "up to +38 %", SIMULATION),
    ),
    "accelerometer": (
        ReferenceFigure("condition number, six faces", "5.7", SIMULATION),
        ReferenceFigure("condition number, poses within ± 30°", "141 (unusable)", SIMULATION),
        ReferenceFigure("resolution of the sensor", "0.0383 m/s² (0.0039 g)", PAPER + ", Sec. 2"),
    ),
    "gyroscope": (
        ReferenceFigure("largest standard deviation of a still sensor", "1 °/s", SIMULATION),
        ReferenceFigure("resolution of the sensor", "0.586 °/s", PAPER + ", Sec. 2"),
    ),
}
"""The reference figures by experiment."""
