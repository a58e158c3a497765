"""Bodies of a page's requests: JSON with known fields and finite numbers, or bytes."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from starlette.requests import Request


class Body(BaseModel):
    """Body that refuses unknown fields."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


async def read_body(request: Request, limit: int) -> bytes:
    """Read a body, of a larger one only a little more than `limit`, so that its reader refuses it.

    Raises ClientDisconnect.
    """
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > limit:
            break
    return bytes(body)
