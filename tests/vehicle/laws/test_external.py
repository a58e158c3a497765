"""External laws: a file that flies, files that do harm, and swaps in flight."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from control.controller import GeometricController
from control.geometric_law import apply_wrench
from control.parameters import ControlParameters
from quadlab.simulated.parameters import FlightParameters
from quadrotor.parameter_description import ParameterValue
from tests.support.lab import Lab, flight_parameters, refusal
from tests.support.law_bench import LawBench
from vehicle.laws.laws import Laws

GOOD = """
import numpy as np

def pipes():
    import os
    names = {int(f): f"/proc/self/fd/{f}" for f in os.listdir("/proc/self/fd")}
    there = {f: os.readlink(one) for f, one in names.items() if os.path.lexists(one)}
    return [f for f, to in there.items() if f > 2 and to.startswith("pipe")]

class law:
    def reset(self):
        self.integral = np.zeros(3)

    def step(self, x):
        e = x.reference_position_w - x.position_w
        if x.flying:
            self.integral += e * x.dt
        a = (x.reference_acceleration_w + 4.0 * e + self.integral
             + 3.5 * (x.reference_velocity_w - x.velocity_w) + [0.0, 0.0, 9.81])
        w, *v = x.quaternion_wb
        v = np.array(v)
        R = ((w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v)
             + 2.0 * w * np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]))
        z = a / np.linalg.norm(a)
        heading = np.array([np.cos(x.reference_yaw), np.sin(x.reference_yaw), 0.0])
        y = np.cross(z, heading)
        y /= np.linalg.norm(y)
        D = np.stack([np.cross(y, z), y, z], axis=1)
        E = R.T @ D - D.T @ R
        e_R = 0.5 * np.array([E[2, 1], E[0, 2], E[1, 0]])
        rates = np.array([0.0, 0.0, x.reference_yaw_rate])
        torque = x.inertia_b * ([60.0, 60.0, 12.0] * e_R
                                + [12.0, 12.0, 5.0] * (rates - x.angular_velocity_b))
        HARM
        return x.mass * (a @ R[:, 2]), torque
"""
"""Law after Lee et al. 2010 without feed-forward of rates."""
CREEPS = "if x.time > 4.5: torque[0] += 0.08 * (x.time - 4.5)"
AT_ONCE = {
    "raises": ("if x.time > 0.041: 1 / 0", "ZeroDivisionError: division by zero"),
    "too strong": ("if x.time > 0.041: torque[0] = 2.0", "torque is 2.0"),
    "no thrust": ("if x.time > 0.041: a *= 0.0", "its thrust is 1.00 of the weight"),
    "nan": ("if x.time > 0.041: torque[1] = np.nan", "not finite"),
    "inf": ("if x.time > 0.041: a[2] = np.inf", "not finite"),
    "stalls": ("if x.time > 0.041: import time; time.sleep(10)", "no answer in time to 1 inputs"),
    "memory": ("if x.time > 0.041: self.hoard = bytearray(3 << 29)", "MemoryError"),
    "ends": ("if x.time > 0.041: raise SystemExit", "SystemExit"),
    "crashes": (
        "if x.time > 0.041: import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
        "killed by SIGSEGV",
    ),
    "writes": (
        "if x.time > 0.041: import os; [os.write(f, b'[' * 9000 + b'\\n1\\n') for f in pipes()];"
        " os._exit(3)",
        "its process ended with status 3",
    ),
    "wrong shape": ("if x.time > 0.041: torque = np.zeros(7)", "ValueError"),
}
"""Harm done in tick 21, which is noticed without a flight."""


@pytest.fixture
def fly(tmp_path: Path) -> Iterator[Callable[..., Lab]]:
    """Make a lab with one law file, chosen on the ground."""
    labs: list[Lab] = []

    def made(source: str, name: str = "mine", **settings: ParameterValue) -> Lab:
        (tmp_path / f"{name}.py").write_text(textwrap.dedent(source))
        lab = Lab(flight_parameters(), plugins=tmp_path)
        labs.append(lab)
        lab.ready()
        lab.change(dict(settings) or {"control.law": name})
        return lab

    yield made
    for lab in labs:
        lab.stack.law.close()


def good(harm: str = "pass") -> str:
    return GOOD.replace("HARM", harm)


def test_a_law_of_a_file_hovers_where_it_should_and_nothing_is_compiled_in_its_first_tick(
    fly: Callable[..., Lab],
) -> None:
    lab = fly(good())
    before = len(apply_wrench.signatures)  # type: ignore[attr-defined]  # compiled by numba
    assert before >= 1
    lab.hovering(settling=2.5)
    assert len(apply_wrench.signatures) == before  # type: ignore[attr-defined]
    external = lab.stack.law.external
    assert external is not None
    assert external.flown
    assert external.missed == 0
    assert external.ticks > 1500
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.03)
    lab.start("land")
    lab.wait_until(lambda v: not v.armed, what="landed", timeout=15)
    lab.advance()
    assert "law mine is ready" in lab.said
    assert re.search(r"law mine: 0 of \d+ inputs without an answer in time; its thrust", lab.said)
    assert "disengaged" not in lab.said


@pytest.mark.parametrize("kind", AT_ONCE)
def test_in_the_tick_in_which_a_law_fails_the_built_in_one_already_flies(
    tmp_path: Path, kind: str
) -> None:
    harm, why = AT_ONCE[kind]
    (tmp_path / "mine.py").write_text(good(harm))
    law = Laws(tmp_path).start("mine", GeometricController(), ControlParameters())
    bench = LawBench(law)
    bench.ticks(21)
    assert (law.failure, bench.flies_built_in) == ("", False)
    bench.ticks(1)
    assert why in law.failure
    assert bench.flies_built_in
    law.close()


def test_a_law_that_creeps_is_taken_out_and_the_built_in_one_flies_on(
    fly: Callable[..., Lab],
) -> None:
    lab = fly(good(CREEPS))
    lab.hovering()
    lab.wait_until(lambda _: "disengaged" in lab.said, what="the rescue", timeout=15)
    lab.wait(2.0)
    assert lab.parameter("control.law") == "geometric"
    assert lab.stack.law.external is None
    line = next(text for text in lab.kept.texts if "disengaged" in text)
    assert "position is 0.5" in line
    assert [c.name for c in lab.kept.changes if c.requester == "vehicle"] == ["control.law"]
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.1)


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("def law(:", "mine.py line 1: SyntaxError"),
        ("x = 1\nraise OSError('no device')", "mine.py line 2: OSError: no device"),
        ("x = 1", "defines no 'law'"),
        ("class law:\n    def step(self, x): ...", "has no method reset"),
    ],
)
def test_a_file_that_is_no_law_is_told_before_arming(
    fly: Callable[..., Lab], source: str, why: str
) -> None:
    lab = fly(source)
    lab.advance()
    lab.advance()
    assert why in lab.said
    assert lab.parameter("control.law") == "geometric"


def test_a_law_runs_beside_takes_over_in_flight_and_hands_back(fly: Callable[..., Lab]) -> None:
    lab = fly(good(), **{"control.shadow_law": "mine"})
    lab.hovering(settling=0.5)
    external = lab.stack.law.external
    assert external is not None
    assert [external.flown] == [False]
    assert 0.0 < external.difference < 1.0
    lab.change({"control.law": "mine"})
    lab.wait(0.7)
    assert [external.flown] == [True]
    assert lab.stack.law.external is external
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    lab.change({"control.law": "geometric"})
    lab.wait(0.5)
    assert [external.flown] == [False]
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    assert "disengaged" not in lab.said


def test_changes_that_cannot_be_are_refused_by_name(
    fly: Callable[..., Lab], tmp_path: Path
) -> None:
    lab = fly(good(), **{"control.law": "geometric"})
    reason = refusal(lambda: lab.change({"control.law": "mein"}))
    assert ", ".join((*Laws().names(), "mine")) in reason
    shadow: dict[str, ParameterValue] = {"control.shadow_law": "geometric"}
    assert "'geometric' is not one of none, " in refusal(lambda: lab.change(shadow))
    both: dict[str, ParameterValue] = {"control.law": "mine", "control.shadow_law": "udp"}
    assert "one external law" in refusal(lambda: lab.change(both))
    parameters = flight_parameters()
    parameters.control.law = "mein"
    assert "'mein' is not a law" in refusal(lambda: Lab(parameters))
    twin = tmp_path / "mine.fmu"
    twin.write_bytes(b"")
    both_named = refusal(lambda: lab.change({"control.law": "mine"}))
    assert "have this name, mine.fmu and mine.py" in both_named
    twin.unlink()
    lab.hovering()
    assert "set control.shadow_law before" in refusal(lambda: lab.change({"control.law": "mine"}))
    assert "on the ground" in refusal(lambda: lab.change({"control.shadow_law": "mine"}))
    assert lab.parameter("control.law") == "geometric"


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Install a package with one module that offers laws as entry points."""
    place = tmp_path / "site"

    def installed(source: str, entries: str) -> None:
        facts = place / "some_laws-1.0.dist-info"
        facts.mkdir(parents=True)
        (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: some-laws\nVersion: 1.0\n")
        (facts / "entry_points.txt").write_text(f"[quadlab.laws]\n{entries}\n")
        (place / "some_laws.py").write_text(textwrap.dedent(source))
        monkeypatch.syspath_prepend(place)
        monkeypatch.setenv("PYTHONPATH", str(place))  # for the law's process

    return installed


def test_a_law_of_an_installed_package_flies_and_one_that_fails_is_named_with_its_line(
    fly: Callable[..., Lab], package: Callable[[str, str], None]
) -> None:
    harm = "if x.time > 3.0: 1 / 0"
    source = good(harm).replace("class law:", "class Mine:")
    package(source, "packaged = some_laws:Mine\nlost = some_laws:Nothing\nmine = some_laws:Mine")
    lab = fly(good(), **{"control.law": "geometric"})
    assert "have this name, mine.py and quadlab.laws=some_laws:Mine" in refusal(
        lambda: lab.change({"control.law": "mine"})
    )
    lab.change({"control.law": "lost"})
    lab.wait_until(lambda _: lab.parameter("control.law") == "geometric", what="lost", timeout=5)
    assert "no attribute 'Nothing'" in lab.said
    lab.change({"control.law": "packaged"})
    lab.hovering()
    assert "law packaged is ready" in lab.said
    lab.wait_until(lambda _: lab.parameter("control.law") == "geometric", what="out", timeout=15)
    line = source.splitlines().index("        " + harm) + 1
    assert f"some_laws.py line {line}: ZeroDivisionError" in lab.said
    lab.wait(1.0)
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.1)


def test_a_port_in_use_is_told_and_changes_nothing_in_flight(fly: Callable[..., Lab]) -> None:
    lab = fly(good(), **{"control.plugin.udp_peer": "nowhere"})
    lab.change({"control.law": "udp"})
    lab.advance()
    lab.advance()
    assert "udp_peer = 'nowhere'" in lab.said
    assert lab.parameter("control.law") == "geometric"


def test_parameters_of_a_flight_may_name_a_law_before_it_begins(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(good())
    parameters: FlightParameters = flight_parameters()
    parameters.control.law = "mine"
    lab = Lab(parameters, plugins=tmp_path).ready()
    assert lab.stack.law.external is not None
    assert lab.stack.law.external.flown
    lab.stack.law.close()
