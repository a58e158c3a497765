"""Estimators from FMUs of FMI 2 and 3."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from estimation import names
from extensions.fmu.description import write_fmu
from extensions.fmu.models import Variable
from extensions.fmu.plugin import FmuPlugin
from extensions.fmu.tests.fmus import renamed
from quadrotor.errors import UsageError
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, flight_parameters
from vehicle.estimators.contract import ESTIMATOR, INPUT, INPUT_TYPE, OUTPUT, OUTPUT_TYPE
from vehicle.estimators.offer import offer_estimators
from vehicle.plugins.contract import Field, as_attributes, names_of

pytestmark = pytest.mark.needs("gcc")
Build = Callable[[int], Path]
SOURCE = Path(__file__).with_name("own_estimator.c")
TAKEN = """reset start_position_w start_velocity_w start_quaternion_wb specific_force_b
angular_velocity_b pose_count pose_position_w pose_quaternion_wb""".split()  # noqa: SIM905
GIVEN = ["position_w", "velocity_w", "quaternion_wb"]
SEED = 405


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[int], Path]:
    """Return the FMU of the estimator in C, compiled once for each version of FMI."""

    @cache
    def built(fmi: int) -> Path:
        path = tmp_path_factory.mktemp("fmu") / "own.fmu"
        shown = [Variable("gain", "parameter", "tunable", 0.1, "", "of poses", 0.0, 1.0)]
        for fields, taken, causality in ((INPUT, TAKEN, "input"), (OUTPUT, GIVEN, "output")):
            start = 0.0 if causality == "input" else None
            for one in (one for one in fields if one.name in taken):
                shown += [
                    Variable(name, causality, "continuous", start, one.unit, "")
                    for name in names_of(one)
                ]
        shown.append(Variable("order", "parameter", "tunable", 1.0, "", "", integer=True))
        write_fmu(SOURCE, shown, path, fmi)
        return path

    return built


def inputs(count: int) -> Iterator[np.recarray]:
    """Yield inputs of a vehicle that is shaken, the first with `reset`."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    for k in range(count):
        x = np.zeros(1, INPUT_TYPE)
        x["time"], x["dt"], x["reset"] = 0.002 * (k + 1), 0.002, k == 0
        x["start_position_w"], x["start_quaternion_wb"] = (0.1, 0.2, 1.0), (1.0, 0.0, 0.0, 0.0)
        x["specific_force_b"] = rng.normal((0.0, 0.0, 9.81), 1.0)
        x["angular_velocity_b"] = rng.normal(0.0, 1.0, 3)
        x["pose_count"], x["pose_position_w"] = k % 5 == 0, rng.normal((0.0, 0.0, 1.0), 0.1)
        x["pose_quaternion_wb"] = (-1.0, 0.0, 0.0, 0.0)
        yield as_attributes(x)


def test_an_fmu_in_c_flies_the_vehicle_as_its_estimator(build: Build) -> None:
    parameters = flight_parameters()
    path = build(2)
    parameters.estimation.estimator, folder = path.stem, path.parent
    offer_estimators(folder)
    try:
        lab = Lab(parameters, plugins=folder).hovering(settling=0.5)
    finally:
        names.offer(())
    assert lab.stack.navigation.externals, lab.said
    (external,) = lab.stack.navigation.externals
    assert (external.flown, external.missed, external.failure) == (True, 0, "")
    assert lab.parameter("estimation.estimator") == "own"
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.06)
    assert external.difference < 0.05
    lab.stack.close()


def test_fmi_2_and_3_answer_the_same_and_what_they_lack_is_as_in_python(build: Build) -> None:
    found = []
    for fmi in (2, 3):
        plugin, out = FmuPlugin(ESTIMATOR, build(fmi)), np.zeros(1, OUTPUT_TYPE)
        for x in inputs(50):
            ESTIMATOR.step(plugin, x, out)
        found.append(out)
    assert found[0].tobytes() == found[1].tobytes()
    answer = found[0][0]
    assert answer["time"] == pytest.approx(0.1)
    assert np.linalg.norm(answer["position_w"] - [0.0, 0.0, 1.0]) < 0.3
    assert np.linalg.norm(answer["quaternion_wb"]) == pytest.approx(1.0)
    assert answer["gyroscope_bias_b"].tolist() == [0.0, 0.0, 0.0]
    assert np.isnan(answer["position_variance_w"]).all()


def test_a_reset_begins_at_the_start_state_again_and_keeps_the_parameters(build: Build) -> None:
    plugin, out = FmuPlugin(ESTIMATOR, build(2)), np.zeros(1, OUTPUT_TYPE)
    ParameterStore(plugin.parameters).set({"gain": 0.0})
    for _ in range(2):
        for x in inputs(2):
            ESTIMATOR.step(plugin, x, out)
        assert out["position_w"][0] == pytest.approx([0.1, 0.2, 1.0], abs=1e-4)


@pytest.mark.parametrize(
    ("fmi", "names", "why"),
    [
        (3, {"pose_count": "poses"}, r"own.fmu: unknown inputs poses; allowed are time, dt, reset"),
        (
            2,
            {"velocity_w[2]": "speed"},
            r"as estimator it needs the outputs position_w\[1\] to position_w\[3\], velocity_w.* "
            r"and quaternion_wb\[1\] to quaternion_wb\[4\], and has position_w\[1\]",
        ),
    ],
)
def test_an_fmu_with_other_variables_is_refused_in_one_line(
    tmp_path: Path, build: Build, fmi: int, names: dict[str, str], why: str
) -> None:
    with pytest.raises(UsageError, match=why) as caught:
        FmuPlugin(ESTIMATOR, renamed(build(fmi), names, tmp_path))
    assert "\n" not in str(caught.value)


def test_a_table_is_named_by_row_and_column() -> None:
    names = names_of(Field("beacon_w", 96, "m", "", (32, 3)))
    assert (names[:4], names[-1], len(names)) == (
        ["beacon_w[1,1]", "beacon_w[1,2]", "beacon_w[1,3]", "beacon_w[2,1]"],
        "beacon_w[32,3]",
        96,
    )
    assert names == names_of(next(f for f in ESTIMATOR.input_fields if f.name == "beacon_w"))
