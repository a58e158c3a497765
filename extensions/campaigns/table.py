"""The rows of files as one table, and what its columns are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from extensions.campaigns.plan import Value
from quadrotor.errors import StorageError

if TYPE_CHECKING:
    import pyarrow as pa

Facts = dict[str, Any]
"""What is told of a campaign, as JSON has it."""
FIXED_COLUMNS = ("index", "seed")
MACHINE = ("wall_", "processor_", "worker", "host")
"""How the names of columns begin that depend on the computer."""


def joined(parts: Sequence[Path], factors: Sequence[str], where: Path) -> pa.Table:
    """Return the rows of files, each flight once, in the order of their index.

    Raises StorageError if there are none.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [pq.read_table(part) for part in parts]
    if not tables:
        raise StorageError(f"{where} has no rows yet")
    judged = sorted({name for one in tables for name in judged_metrics(one)})
    whole = pa.concat_tables(tables, promote_options="permissive")
    _, first = np.unique(whole["index"].to_numpy(), return_index=True)
    if len(first) != whole.num_rows or (np.diff(first) < 0).any():
        whole = whole.take(first)
    known = [*FIXED_COLUMNS, *factors, "verdict", "reason"]
    machine = [name for name in whole.column_names if name.startswith(MACHINE)]
    metrics = sorted(set(whole.column_names) - {*known, *machine})
    whole = whole.select([*known, *metrics, *machine]).combine_chunks()
    return whole.replace_schema_metadata({"judged": json.dumps(judged)})


def judged_metrics(table: pa.Table) -> list[str]:
    """Return the metrics that have limits: the smaller the better."""
    found: list[str] = json.loads((table.schema.metadata or {}).get(b"judged", b"[]"))
    return found


def metric_columns(table: pa.Table, factors: Sequence[str]) -> list[str]:
    """Return the names of the metrics."""
    others = {*FIXED_COLUMNS, *factors, "verdict", "reason"}
    return [n for n in table.column_names if n not in others and not n.startswith(MACHINE)]


def array(values: Sequence[Value]) -> pa.Array:
    """Return the values of a factor as a column; as text, if they are of several types."""
    import pyarrow as pa

    kinds = {type(one) for one in values}
    return pa.array(values if len(kinds) == 1 else [str(one) for one in values])
