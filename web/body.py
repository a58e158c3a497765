"""The body of a page's request: JSON with known fields and finite numbers."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Body(BaseModel):
    """A body; an unknown field is refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
