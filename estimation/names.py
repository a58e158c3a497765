"""The names of the estimators: built-in ones, those of extensions, and those that are registered.

A process that only offers the choice, and runs none of them, imports nothing but this.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from estimation.parameters import EstimationParameters
from quadrotor.extension import Estimator
from quadrotor.extensions import Offered, registry
from quadrotor.parameters import offer_choices

BUILT_IN: Mapping[str, str] = {
    "complementary": ".complementary:ComplementaryEstimator",
    "error_state": ".error_state.estimator:ErrorStateEstimator",
}
"""The built-in estimators, and where in this package their code is."""
NONE, UDP = "none", "udp"
"""Values of the parameters that are no estimator of these: no shadow, and a program over UDP."""
registered: dict[str, Callable[[EstimationParameters], Any]] = {}
"""The estimators that `estimation.registry.register` was given in this process, by name."""


def offered() -> dict[str, Offered[Estimator]]:
    """Return the names of the built-in estimators and of those from extensions."""
    found = {
        name: Offered(Estimator(name=name, target=target), __package__)
        for name, target in BUILT_IN.items()
    }
    return found | registry().offers(Estimator, taken=(*BUILT_IN, NONE, UDP))


def names() -> tuple[str, ...]:
    """Return all names that can be chosen."""
    return tuple(dict.fromkeys((*offered(), *registered)))


def offer(plugins: Sequence[str]) -> None:
    """Make these names, too, values of the parameters, in place of those offered before: of
    estimators that whoever makes the parameter tree can start.
    """
    offer_choices(EstimationParameters, "estimator", (*names(), *plugins))
    offer_choices(EstimationParameters, "shadow", (NONE, *names(), *plugins))
