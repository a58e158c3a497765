"""Estimators that extensions offer, by name."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from estimation import names, registry
from estimation.complementary import ComplementaryEstimator
from estimation.estimator import Estimator as AnyEstimator
from estimation.parameters import EstimationParameters
from quadrotor.errors import UsageError
from quadrotor.extension import Estimator, Extension
from quadrotor.extensions import Registry
from tests.support.lab import Lab, refusal


class Mine(ComplementaryEstimator):
    """The built-in one under another name."""


def broken(_: EstimationParameters) -> AnyEstimator:
    return 1 / 0  # type: ignore[return-value]


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Iterator[Registry]:
    """Yield a registry with one extension, in place of the installed ones."""
    offers = {
        "mine": ".test_names:Mine",
        "broken": ".test_names:broken",
        "lost": ".no_such_module:make",
        "complementary": ".test_names:Mine",
        "none": ".test_names:Mine",
    }
    extension = Extension(
        name="own",
        summary="Estimators",
        protocol=1,
        offers=tuple(Estimator(name=name, target=target) for name, target in offers.items()),
    )
    made = Registry([("own", __package__ or "", lambda: extension)])
    monkeypatch.setattr(names, "registry", lambda: made)
    yield made
    monkeypatch.undo()
    names.offer(())


def test_an_estimator_of_an_extension_has_a_name_and_no_other_one_s(found: Registry) -> None:
    assert names.names() == ("complementary", "error_state", "mine", "broken", "lost")
    assert type(registry.create("mine", EstimationParameters())) is Mine
    assert type(registry.create("complementary", EstimationParameters())) is ComplementaryEstimator
    assert [line.split(" is left out")[0] for line in found.problems] == [
        "extension own: its estimator complementary",
        "extension own: its estimator none",
    ]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("lost", "extension own: estimator lost cannot be imported: ModuleNotFoundError"),
        ("broken", "the estimator broken fails at rest: ZeroDivisionError: division by zero"),
    ],
)
def test_an_estimator_that_cannot_run_is_refused_and_nothing_changes(
    found: Registry, name: str, why: str
) -> None:
    with pytest.raises(UsageError, match=why):
        registry.prepare(name, bearings=False)
    names.offer(())
    lab = Lab()
    assert why in refusal(lambda: lab.change({"estimation.estimator": name}))
    assert lab.parameter("estimation.estimator") == "complementary"


def test_an_estimator_of_an_extension_flies(found: Registry) -> None:
    names.offer(())
    lab = Lab()
    lab.change({"estimation.estimator": "mine"})
    lab.hovering(settling=0.5)
    assert type(lab.stack.estimator) is Mine
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.03)
