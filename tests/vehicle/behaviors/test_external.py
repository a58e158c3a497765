"""Behaviors of one's own: they fly, and a harmful one ends in brake in the tick of its failure."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from quadrotor.checkout import ROOT
from quadrotor.errors import RefusedError, UsageError
from quadrotor.parameters import ParameterStore
from quadrotor.records import new_reference, new_state
from tests.support.here_link import HereLink
from vehicle.behaviors.behaviors import OwnBehaviors
from vehicle.behaviors.contract import BEHAVIOR, INPUT, OUTPUT, load
from vehicle.behaviors.external import ExternalBehavior
from vehicle.parameters import new_parameters
from vehicle.plugins import declared

DT = 0.01
DOCUMENT = (ROOT / "docs" / "extending" / "plugins.md").read_text()
SECTION = DOCUMENT.partition("# A behavior of your own")[2].partition("# A sensor of your own")[0]
SWAY = ROOT / "examples" / "behaviors" / "sway.py"
STAY = """
class behavior:
    def reset(self, x):
        self.begin, self.p = x.time, x.reference_position_w.copy()
    def step(self, x):
        t = x.time - self.begin
        HARM
        return (self.p,)
"""
HARM = {
    "raises": ("if t > 0.1: 1 / 0", "line 7: ZeroDivisionError: division by zero"),
    "nan": ("if t > 0.1: self.p[1] = float('nan')", "not finite"),
    "ends": ("if t > 0.1: raise SystemExit", "SystemExit"),
    "wrong shape": ("if t > 0.1: return ([1.0, 2.0, 3.0, 4.0],)", "ValueError"),
    "turns": (
        "if t > 0.1: z = self.p * 0; return (self.p, z, z, z, z, 1.79e308, 1.79e308)",
        "the reference's yaw steps by nan rad",
    ),
    "jumps": ("if t > 0.1: self.p[0] += 0.5", "the reference is 0.50 m off the present one"),
    "stalls": ("if t > 0.1: self.stalls = True", "no answer in time to 1 inputs in a row"),
}


class Bench:
    """A machine that hovers, and a plugin that is asked in each tick of `external`."""

    def __init__(self, path: Path) -> None:
        self.machine = BehaviorMachine(BehaviorParameters())
        self.state, self.reference, self.stamp_ns = new_state(), new_reference(), 0
        self.plugin = ExternalBehavior("mine", HereLink(BEHAVIOR, path), True, self.machine.outside)
        self.machine.request("take_off", {}, self.state, True, True)
        while self.machine.name is not BehaviorName.HOVER:
            self.tick()

    def flies(self, name: BehaviorName) -> bool:
        return self.machine.name is name

    def start(self) -> None:
        self.plugin.becomes_ready()
        self.plugin.begin(self.stamp_ns, self.reference)
        self.machine.request("external", {}, self.state, True, True)

    def tick(self, stick: float | None = None) -> None:
        self.stamp_ns += round(DT * 1e9)
        if self.machine.name is BehaviorName.EXTERNAL:
            joy = None if stick is None else (self.stamp_ns, (stick, 0.0, 0.0, 0.0), True)
            self.plugin.step(self.stamp_ns, DT, self.state, self.reference, joy, 0.2)
        self.machine.step(self.stamp_ns, DT, self.state, None, 12.8, self.reference)

    def fly(self, stick: float | None = None) -> list[float]:
        """Tick until the behavior has ended; return y (m) of each reference."""
        flown = []
        self.start()
        while self.machine.name is BehaviorName.EXTERNAL:
            self.tick(stick)
            flown.append(float(self.reference["position_w"][0, 1]))
        return flown


@pytest.mark.parametrize("kind", HARM)
def test_a_harmful_behavior_ends_in_brake_in_the_tick_of_its_failure(
    tmp_path: Path, kind: str
) -> None:
    harm, why = HARM[kind]
    path = tmp_path / "mine.py"
    path.write_text(STAY.replace("HARM", harm))
    bench = Bench(path)
    flown = bench.fly()
    assert bench.flies(BehaviorName.BRAKE)
    assert len(flown) * DT == pytest.approx(0.1, abs=4 * DT)
    assert why in bench.machine.pop_aborted()
    assert np.isfinite(bench.reference.view("f8")).all()
    while bench.flies(BehaviorName.BRAKE):
        bench.tick()
    assert bench.flies(BehaviorName.HOVER)


def test_the_example_sways_ends_by_itself_and_may_be_flown_again() -> None:
    bench = Bench(SWAY)
    first, quick = bench.fly(), bench.fly(stick=1.0)
    assert (max(first), min(first)) == pytest.approx((0.5, 0.0), abs=1e-3)
    assert len(first) * DT == pytest.approx(12.0, abs=5 * DT)
    assert len(quick) * DT == pytest.approx(8.0, abs=5 * DT)
    assert bench.machine.pop_aborted() == ""


def test_parameters_of_a_file_are_the_vehicles_and_reach_the_plugin(tmp_path: Path) -> None:
    shutil.copy(SWAY, tmp_path)
    try:
        assert declared.offer(tmp_path) == []
        tree = new_parameters()
        store = ParameterStore(tree)
        about = store.description("plugins.sway.width")
        assert (about.unit, about.minimum, about.maximum) == ("m", 0.1, 2.0)
        assert about.description == "of the sway; taken at its beginning"
        store.set({"plugins.sway.width": 0.8})
    finally:
        declared.offer(None)
    bench = Bench(SWAY)
    bench.plugin.give(dict(getattr(tree.plugins, "sway")))  # noqa: B009 - made when it is offered
    assert max(bench.fly()) == pytest.approx(0.8, abs=1e-3)
    assert "plugins" not in str(ParameterStore(new_parameters()).names)


@pytest.mark.parametrize(
    "field",
    [
        "width: float = parameter(WIDE)",
        "width: float = parameter(1.0)",
        "width: list = parameter(1)",
    ],
)
def test_parameters_that_cannot_be_read_are_told_with_their_line(
    tmp_path: Path, field: str
) -> None:
    source = f"WIDE = 1.0\nclass Options(Parameters):\n    {field}\n"
    (tmp_path / "mine.py").write_text(source)
    try:
        (why,) = declared.offer(tmp_path)
    finally:
        declared.offer(None)
    assert "mine.py line 3: parameters of a plugin are written as NAME: float = parameter" in why


def test_the_documents_behavior_climbs_and_ends(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(SECTION.partition("```python\n")[2].partition("```")[0])
    bench = Bench(path)
    bench.fly()
    assert bench.reference["position_w"][0, 2] == pytest.approx(1.5, abs=0.03)
    assert bench.machine.pop_aborted() == ""


def test_the_document_lists_what_a_behavior_receives_and_answers() -> None:
    cells = [line.split("|") for line in SECTION.splitlines()]
    rows = [row[1:5] for row in cells if len(row) == 6 and "`" in row[1]]
    listed = [
        (name.strip(" `"), int(n), unit.strip(), text.strip()) for name, n, unit, text in rows
    ]
    assert listed == [(f.name, f.size, f.unit, f.meaning) for f in (*INPUT, *OUTPUT)]
    assert BEHAVIOR.group in SECTION


def test_a_behavior_is_refused_while_it_loads_and_when_it_is_not_there(tmp_path: Path) -> None:
    bench = Bench(SWAY)
    with pytest.raises(RefusedError, match="behavior mine cannot fly: it is loading"):
        bench.plugin.begin(0, bench.reference)
    (tmp_path / "mine.py").write_text(STAY)
    own = OwnBehaviors(tmp_path, True, bench.machine.outside)
    own.check({"behavior.plugin": "mine"}, armed=False)
    with pytest.raises(RefusedError, match="chosen on the ground"):
        own.check({"behavior.plugin": "mine"}, armed=True)
    with pytest.raises(RefusedError, match=r"'other' is not a behavior; there are none, mine; put"):
        OwnBehaviors(tmp_path, True, bench.machine.outside, "other")


def test_a_file_without_the_methods_is_refused_with_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("class behavior:\n    def reset(self, x): pass\n")
    with pytest.raises(UsageError, match=re.escape("mine.py: behavior has no method step")):
        load(path)
