"""The variables of the two models: parameters by quadlab's names, inputs, outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from quadlab.settings import parse_settings
from quadrotor.errors import UsageError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import Parameters, ParameterStore, parameter
from vehicle.laws.contract import INPUT, OUTPUT, Field
from vehicle.parameters import new_parameters
from vehicle.plugins.contract import names_of
from vehicle.simulator.parameters import SimulatorParameters

PLANT, LAW = "plant", "law"
SIMULATOR = "simulator."
"""Prefix of the plant's names in a whole vehicle's parameters; an FMU has them without it."""


def _start(unit: str, bound: float, text: str) -> float:
    value: float = parameter(0.0, unit=unit, ge=-bound, le=bound, description=text)
    return value


class PlantParameters(SimulatorParameters):
    """The simulated vehicle's true values, and the motion that it begins with."""

    start_z: float = _start("m", 1000.0, "start height; 0 stands on the floor")
    start_velocity_x: float = _start("m/s", 100.0, "start velocity, in W")
    start_velocity_y: float = _start("m/s", 100.0, "start velocity, in W")
    start_velocity_z: float = _start("m/s", 100.0, "start velocity, in W")
    start_roll: float = _start("deg", 180.0, "start roll angle (ZYX)")
    start_pitch: float = _start("deg", 90.0, "start pitch angle (ZYX)")
    start_yaw: float = _start("deg", 180.0, "start yaw angle (ZYX)")
    start_angular_velocity_x: float = _start("rad/s", 100.0, "start angular velocity, in B")
    start_angular_velocity_y: float = _start("rad/s", 100.0, "start angular velocity, in B")
    start_angular_velocity_z: float = _start("rad/s", 100.0, "start angular velocity, in B")
    start_rotor_speed: float = parameter(0.0, unit="count", ge=0.0, le=255.0)
    """start speed of each rotor, as a count of motor reference"""


OF_PLANT = """
start_x start_y start_z start_velocity_x start_velocity_y start_velocity_z start_roll start_pitch
start_yaw start_angular_velocity_x start_angular_velocity_y start_angular_velocity_z
start_rotor_speed battery_charge mass payload inertia_xx inertia_yy inertia_zz arm torque_ratio
motor_time_constant motor_slope motor_offset thrust_efficiency motor_gain_front motor_gain_left
motor_gain_rear motor_gain_right failed_motor drag rotor_drag_x rotor_drag_y drag_lever inflow_loss
wind_x wind_y wind_z push_x push_y push_z ground_effect ground_stiffness ground_damping
ground_friction battery_capacity battery_resistance battery_nominal battery_exponent
""".split()  # noqa: SIM905 - as a list it is one a line
OF_LAW = """control.position. control.attitude. control.limits. model.arm model.torque_ratio
model.motor_slope model.motor_offset model.motor_reference_ model.drag""".split()  # noqa: SIM905
"""Prefixes of the law's parameters."""
MASS = {
    "mass": ("model.mass",),
    "inertia_b": ("model.inertia_xx", "model.inertia_yy", "model.inertia_zz"),
}
"""Inputs of the law that start at parameters of the model."""
FIXED = ("start_", "battery_charge")
"""Prefixes of parameters that describe the start and cannot change later."""

REFERENCES = Field(
    "motor_references", 4, "count", "motors front, left, rear, right, held over a step; 0 to 255"
)
PLANT_INPUT = (
    REFERENCES,
    Field("gust_w", 3, "m/s", "velocity of the air on top of the steady wind, world axes"),
    Field("force_w", 3, "N", "further force on the centre of mass, world axes"),
)
PLANT_OUTPUT = (
    *INPUT[4:8],  # the motion
    Field("rotor_speeds", 4, "count", "as counts of motor reference; front, left, rear, right"),
    Field("thrusts", 4, "N", "front, left, rear, right"),
    Field("specific_force_b", 3, "m/s²", "what an ideal accelerometer reads, body axes"),
    Field("voltage", 1, "V", "of the battery under load"),
)
LAW_INPUT = tuple(f for f in INPUT if f.name not in ("time", "dt"))
LAW_OUTPUT = (*(f for f in OUTPUT if f.name != "time"), REFERENCES)


@dataclass(frozen=True)
class Variable:
    """One number of an FMU. `start` is None for an output."""

    name: str
    causality: str
    variability: str
    start: float | None
    unit: str
    description: str
    minimum: float | None = None
    maximum: float | None = None
    integer: bool = False


def variables(model: str, words: Sequence[str]) -> list[Variable]:
    """Return the variables of PLANT or LAW in the order of their value references.

    Real ones come first: fixed and tunable parameters, inputs, outputs; then integers.

    Args:
        words: `NAME=VALUE`, start values other than the defaults.

    Raises UsageError for a name that the model does not have, and a value out of its bounds.
    """
    is_plant = model == PLANT
    tree: Parameters = PlantParameters() if is_plant else new_parameters()
    changed = parse_settings(tree, [w.removeprefix(SIMULATOR) if is_plant else w for w in words])
    store = ParameterStore(tree)
    names = OF_PLANT if is_plant else [n for n in store.names if n.startswith(tuple(OF_LAW))]
    starts = {} if is_plant else {n: [store.get(p) for p in ps] for n, ps in MASS.items()}
    starts |= {"quaternion_wb": [1.0, 0.0, 0.0, 0.0], "flying": [1.0]}
    known = {*names, *(p for ps in MASS.values() for p in ps)}
    for name, value in changed.items():
        if name not in known and value != store.description(name).default:
            raise UsageError(
                f"--set {name}: the FMU of the {model} does not have it; "
                "docs/extending/fmu_export.md lists what it has"
            )
    out = [_of_parameter(store.description(name), store.get(name)) for name in names]
    for f in PLANT_INPUT if is_plant else LAW_INPUT:
        numbers = starts.get(f.name, [0.0] * f.size)
        for name, value in zip(names_of(f), numbers, strict=True):
            out.append(Variable(name, "input", "continuous", float(value), f.unit, f.meaning))
    for f in PLANT_OUTPUT if is_plant else LAW_OUTPUT:
        for name in names_of(f):
            out.append(Variable(name, "output", "continuous", None, f.unit, f.meaning))
    return sorted(out, key=lambda one: one.integer)


def _of_parameter(one: ParameterDescription, value: ParameterValue) -> Variable:
    """Return a parameter as a variable; of a text, the number of the choice, from 1."""
    variability = "fixed" if one.name.startswith(FIXED) else "tunable"
    text, low, high = one.description, one.minimum, one.maximum
    if isinstance(value, str):
        low, high, value = 1, len(one.choices), one.choices.index(value) + 1
        text = ", ".join(f"{n}: {word}" for n, word in enumerate(one.choices, 1)) + f"; {text}"
    integer = one.type != "float"
    return Variable(
        one.name,
        "parameter",
        variability=variability,
        start=value,
        unit=one.unit,
        description=text,
        minimum=low,
        maximum=high,
        integer=integer,
    )
