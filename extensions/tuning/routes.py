"""Routes below /api/tuning: start a step test, read the newest ones, restore their gains."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Literal

from fastapi import FastAPI
from pydantic import Field

from control.trajectories.multistep import AXES, SHAPES
from extensions.tuning.evaluation import Plan, drawn, evaluate
from extensions.tuning.step_response import BAND
from extensions.tuning.step_test_store import StepTest, StepTestStore
from extensions.tuning.step_tests import StepTests
from quadrotor.errors import RefusedError
from quadrotor.json_object import JsonObject
from quadrotor.parameter_description import ParameterValue
from web.access.requester import Operator
from web.body import Body
from web.feature import Feature

if TYPE_CHECKING:
    from web.vehicle_context import VehicleContext

LIMITS = {"position": "behavior.excite_position_max", "yaw": "behavior.excite_yaw_max"}
"""Parameters with the largest amplitudes, for the page's form."""


class TestBody(Body):
    """Step test; the vehicle checks it against its limits."""

    axis: Literal["x", "y", "z", "yaw"] = "x"
    shape: Literal["step", "doublet"] = "step"
    amplitude: float = Field(0.3, ge=-6.3, le=6.3, description="m or rad")
    duration: float = Field(2.0, ge=0.2, le=10.0, description="s of each level")
    repeats: int = Field(1, ge=1, le=5)


def add_tuning(app: FastAPI, context: VehicleContext) -> None:
    kept = StepTestStore(context.catalogue.folder.parent)
    step_tests = StepTests(
        context.station, context.live, context.replica, context.hub, kept, context.vehicle
    )

    @app.get("/api/tuning")
    def tuning() -> JsonObject:
        """Return the state of the test, the stored tests, newest first, and the allowed options."""
        return {
            "status": step_tests.status,
            "axes": AXES,
            "shapes": SHAPES,
            "amplitude_max": {axis: context.replica.value(name) for axis, name in LIMITS.items()},
            "settling_band": BAND,
            "runs": [asdict(run) for run in kept.runs()],
        }

    @app.post("/api/tuning/run")
    async def run(body: TestBody, session: Operator) -> dict[str, bool]:
        """Run a test from hover.

        The answer is sent when the vehicle has begun; the rest is published as `tuning`.
        """
        await step_tests.start(Plan(**body.model_dump()), session.label)
        return {"accepted": True}

    @app.get("/api/tuning/runs/{run_id}")
    def one(run_id: str) -> JsonObject:
        """Return set-point and actual at every tick, s since the first edge; null in a gap."""
        found = kept.run(run_id)
        return {**asdict(found), **drawn(evaluate(kept.samples(run_id), found.plan))}

    @app.delete("/api/tuning/runs/{run_id}")
    def delete(run_id: str, _: Operator) -> dict[str, str]:
        """Delete a test; `restore` undoes it."""
        kept.delete(run_id)
        step_tests.kept_changed()
        return {"deleted": run_id}

    @app.post("/api/tuning/runs/{run_id}/restore")
    def restore(run_id: str, _: Operator) -> dict[str, str]:
        kept.restore(run_id)
        step_tests.kept_changed()
        return {"restored": run_id}

    @app.post("/api/tuning/runs/{run_id}/gains")
    async def put_back(run_id: str, session: Operator) -> JsonObject:
        """Restore the gains of this test as one change, all or none; only numbers.

        The choice of law or estimator is not changed: it is made where the vehicle can check it.
        """
        changes, left = _differences(kept.run(run_id), step_tests)
        if not changes:
            raise RefusedError(
                "the gains of this test are in force already"
                + (f"; of another kind and left: {', '.join(left)}" if left else "")
            )
        applied, revision = await context.gains.change(changes, session.label, walks=True)
        return {"applied": applied, "revision": revision, "left": left}


def _differences(
    run: StepTest, step_tests: StepTests
) -> tuple[dict[str, ParameterValue], list[str]]:
    """Return the numbers to be changed, and the names of other parameters that differ."""
    now = step_tests.gains()
    differing = {n: v for n, v in run.gains.items() if n in now and now[n] != v}
    numbers = {n: v for n, v in differing.items() if type(v) in (int, float)}
    return numbers, [n for n in differing if n not in numbers]


FEATURE = Feature(add_tuning)
