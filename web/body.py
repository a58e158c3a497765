"""Bodies of a page's requests: JSON with known fields and finite numbers; their sizes."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from starlette.datastructures import Headers

LARGEST, LARGEST_JSON = 16_000_000, 500_000
"""Largest body of a request, and of one that is read as JSON, in bytes."""


class Body(BaseModel):
    """Body that refuses unknown fields."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def refused_size(headers: Headers) -> tuple[int, str] | None:
    """Return status and reason if a body would fill the memory, or as JSON hold the page up."""
    if "transfer-encoding" in headers:
        return 411, "the request does not state its size; send it with Content-Length"
    limit = LARGEST_JSON if "json" in headers.get("content-type", "json") else LARGEST
    size = int(headers.get("content-length", 0))
    return (413, f"the request has {size} bytes; allowed are {limit}") if size > limit else None
