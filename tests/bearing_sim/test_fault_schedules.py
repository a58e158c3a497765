"""Schedules of faults: when they are on, what is refused, and clocks of their own."""

from __future__ import annotations

import pytest

from bearing_sim.faults import bearings, tracker
from bearing_sim.faults.fault import Faults, by_home
from bearing_sim.faults.schedule import WORDS, Schedule
from bearing_sim.tracker import TrackerParameters
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import ParameterStore
from vehicle.simulator.faults import table
from vehicle.simulator.parameters import SimulatorParameters

MS = 1_000_000
CATALOGUES = (tracker.CATALOGUE, bearings.CATALOGUE, table.CATALOGUE)


def schedule(**values: float) -> Schedule:
    made = Schedule()
    ParameterStore(made).preset(
        {one + "_" * (one in ("from", "for")): values[one] for one in values}
    )
    return made


def on(of: Schedule, seconds: float, seed: int = 1) -> list[int]:
    """Return the milliseconds at which it is on."""
    return [k for k in range(round(1e3 * seconds)) if of.at(k * MS, seed, 7) is not None]


def refusal(text: str) -> str:
    """Return the line with which the tracker's parameters refuse these faults."""
    store = ParameterStore(TrackerParameters())
    with pytest.raises(OutOfBoundsError) as caught:
        store.set({"faults": text})
    assert store.get("faults") == ""
    said = str(caught.value)
    assert "\n" not in said
    return said


def test_a_pulse_is_on_from_its_beginning_until_before_its_end() -> None:
    assert on(schedule(**{"from": 0.3, "to": 0.5}), 1.0) == [*range(300, 500)]
    assert on(schedule(**{"from": 0.3, "for": 0.2}), 1.0) == [*range(300, 500)]
    assert on(schedule(), 0.1) == [*range(100)]


def test_a_ramp_grows_linearly_to_full_strength_and_stays_there() -> None:
    ramp = schedule(**{"from": 1.0, "ramp": 2.0})
    moments = [ramp.at(k * 500 * MS, 1, 7) for k in range(2, 9)]
    assert [one.level for one in moments if one] == [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0]
    assert [one.elapsed for one in moments if one] == [0.5 * k for k in range(7)]


def test_a_periodic_fault_comes_again_in_each_period_and_counts_from_each_beginning() -> None:
    periodic = schedule(**{"from": 0.1, "every": 0.4, "for": 0.15, "to": 1.0})
    assert on(periodic, 1.5) == [*range(100, 250), *range(500, 650), *range(900, 1000)]
    again = periodic.at(510 * MS, 1, 7)
    assert again is not None
    assert (again.elapsed, again.spell_ns) == (0.01, 500 * MS)


def test_a_random_fault_is_on_for_its_share_in_spells_and_the_same_for_a_seed() -> None:
    chance = schedule(share=0.25, spell=0.05)
    times = on(chance, 40.0)
    assert times == on(chance, 40.0)
    assert times != on(chance, 40.0, seed=2)
    # A spell of 50 ms in each of 200 periods of 200 ms; the first and the last may be cut.
    assert len(times) == pytest.approx(10_000, abs=100)
    begun = {m.spell_ns for k in times if (m := chance.at(k * MS, 1, 7))}
    assert len(begun) == pytest.approx(200, abs=1)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("tracker.freez", ("did you mean tracker.freeze", "docs/how_to/faults.md")),
        ("freeze", ("no fault is called 'freeze'", "docs/how_to/faults.md")),
        ("tracker.freeze from=4 to=3", ("never begins", "4 s", "3 s")),
        ("tracker.freeze share=0", ("never begins", "share = 0")),
        ("tracker.freeze from=1 to=3; tracker.freeze from=2", ("overlap", "end the first")),
        ("tracker.freeze to=3 for=2", ("both 'for' and 'to'",)),
        ("tracker.freeze every=2", ("every = 2 s needs 'for'",)),
        ("tracker.freeze every=2 for=1 share=0.5", ("periodic and random",)),
        ("tracker.drift x=7", ("x = 7 is out of bounds", "-1 to 1 m/s")),
        ("tracker.freeze what=all", ("pose, position, attitude",)),
        ("tracker.freeze from=soon", ("from must be a number",)),
        ("tracker.freeze x", ("'x' is not understood", "what, from, to, for")),
        ("tracker.freeze from=1 from=2", ("from is given twice",)),
        ("tracker.delay", ("it needs value",)),
        ("tracker.delay value=2", ("delay = 2 is out of bounds", "0 to 0.5 s")),
        ("tracker.seed value=2", ("no fault is called 'tracker.seed'",)),
        ("barometer.ramp", ("belongs in simulator.faults",)),
    ],
)
def test_what_is_wrong_is_refused_in_one_line_with_what_to_try(
    text: str, parts: tuple[str, ...]
) -> None:
    said = refusal(text)
    assert said.startswith("tracker.faults: ")
    for part in parts:
        assert part in said


def test_faults_of_one_name_may_follow_one_another_or_act_on_different_things() -> None:
    store = ParameterStore(SimulatorParameters())
    for text in (
        "barometer.ramp to=2; barometer.ramp rate=-5 from=2",
        "motors.fade motor=front; motors.fade motor=rear",
        "simulator.gust value=1; simulator.push_x value=2",
    ):
        assert store.set({"faults": text}) == {"faults": text}
    with pytest.raises(OutOfBoundsError, match="overlap"):
        store.set({"faults": "motors.fade motor=rear; motors.fade motor=rear gain=0.5"})


def test_an_entry_that_stays_keeps_its_clock_when_others_come_and_go() -> None:
    p, faults = TrackerParameters(), Faults(tracker.CATALOGUE)
    faults.set("tracker.scale", p, 1000 * MS)
    faults.set("tracker.tilt from=1; tracker.scale", p, 3000 * MS)
    [scale] = faults.active(3500 * MS, 1)
    assert scale.moment.elapsed == 2.5
    tilt, scale = faults.active(4500 * MS, 1)
    assert (tilt.moment.elapsed, scale.moment.elapsed) == (0.5, 3.5)
    faults.set("tracker.tilt from=1", p, 5000 * MS)
    assert [one.fault.name for one in faults.active(5000 * MS, 1)] == ["tracker.tilt"]


def test_faults_begin_anew_in_a_simulation_that_is_started_again() -> None:
    faults = Faults(tracker.CATALOGUE)
    faults.set("tracker.scale from=1", TrackerParameters(), 9000 * MS)
    assert len(faults.active(10_500 * MS, 1)) == 1
    assert faults.active(0, 1) == []
    assert faults.active(999 * MS, 1) == []
    [scale] = faults.active(1200 * MS, 1)
    assert scale.moment.elapsed == pytest.approx(0.2)


def test_one_text_of_all_faults_is_divided_by_subject() -> None:
    text = "tracker.freeze from=3;  barometer.ramp; bearings.lens k=0.1; tracker.drop_out value=1"
    assert by_home(text) == {
        "tracker.faults": "tracker.freeze from=3; tracker.drop_out value=1",
        "simulator.faults": "barometer.ramp",
        "bearings.faults": "bearings.lens k=0.1",
    }
    assert by_home("nonsense") == {"simulator.faults": "nonsense"}


def test_every_declaration_is_complete() -> None:
    names: set[str] = set()
    for catalogue in CATALOGUES:
        for name, declared in catalogue.faults.items():
            assert name not in names
            names.add(name)
            assert declared.__doc__
            assert declared.source
            described = ParameterStore(declared()).descriptions()
            assert set(declared.of) <= {one.name for one in described}
            for one in described:
                assert one.name not in WORDS
                assert one.type in ("str", "bool") or None not in (one.minimum, one.maximum)
