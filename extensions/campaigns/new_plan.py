"""A plan to start from, with a comment on each part, and the schema by which editors check it."""

from __future__ import annotations

import json
from pathlib import Path

from console.atomic_file import replacing
from extensions.campaigns.plan import Plan
from quadrotor.errors import StorageError, os_errors

TEXT = """\
#:schema ./{schema}
# quadlab campaign check {name}                 what it flies, and how long that may take
# quadlab campaign run {name} --out campaign    flies it; the same command continues it

experiment = "figure_eight"  # any of `quadlab fly`, a file of your own, or "closed_loop"
# logs = "runs/*"            # with experiment = "explanation" or "replay": over recorded flights
seeds = 4                    # flights in each cell
# seed = 1                   # from which the seed of each flight follows
# vehicles = 1               # that fly together in each flight
# board = "mikrokopter"
# law = "geometric"
# estimator = "complementary"
# true_state = false
# plugins = "plugins"        # folder of your own laws and estimators
# faults = "motors.fade from=12 ramp=3"
# time_limit = 600           # s of wall time for one flight

# How cells are made: grid (all combinations), zip (the k-th values together), one_at_a_time (each
# factor through its values, the others at their first), or samples = N cells that are random,
# latin_hypercube or sobol.
design = "grid"
# samples = 64

# metrics = ["position_rms_m"]        # the metrics to keep; all without this line
# limits = {{ position_rms_m = 0.01 }}  # fails a flight beyond, in addition to the experiment's own

[fixed]                      # parameters of every flight, as for `quadlab fly --set`
"simulator.drag" = 0.02

[factors]                    # parameters that differ from cell to cell
"control.position.kp_xy" = [3.0, 4.0, 5.0]
# "simulator.payload" = {{ from = 0.0, to = 0.3, number = 4 }}
# "tracker.delay" = {{ from = 0.005, to = 0.08, number = 5, log = true }}
# "simulator.wind_x" = {{ distribution = "norm", loc = 0.0, scale = 2.0, number = 5 }}

# [cases.world]              # a factor called world; each of its cases has several settings
# calm = {{}}
# windy = {{ "simulator.drag" = 0.3, "simulator.wind_x" = 5.0, "simulator.gust" = 1.5 }}

[keep]
logs = "failed"              # none, failed, all; worst, with number = 5, metric = "position_rms_m"
"""


def write(path: Path) -> list[Path]:
    """Write the plan and its schema; return both. Raises StorageError if the plan exists."""
    if path.exists():
        raise StorageError(f"{path} exists; give another --out FILE")
    schema = path.with_name(f"{path.stem}.schema.json")
    with os_errors(lambda why: f"{path} cannot be written ({why}); give another --out FILE"):
        with replacing(schema) as new:
            described = Plan.model_json_schema(by_alias=True)
            new.write_text(json.dumps(described, indent=1) + "\n")
        with replacing(path) as new:
            new.write_text(TEXT.format(name=path.name, schema=schema.name))
    return [path, schema]
