"""Body of a page's request: JSON with known fields and finite numbers."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class Body(BaseModel):
    """Body that refuses unknown fields."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
