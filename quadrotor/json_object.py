"""Types of what is encoded as JSON, with all that is inside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Json = None | bool | int | float | str | Sequence["Json"] | Mapping[str, "Json"]
    JsonObject = Mapping[str, Json]
else:  # FastAPI needs a type that it can describe
    JsonObject = dict[str, object]
