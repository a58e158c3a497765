"""Bodies of `POST /api/commands/…`: the requests of a page to the vehicle."""

from __future__ import annotations

from typing import Any, Literal

from msgspec.structs import fields as fields_of
from pydantic import Field, create_model

from vehicle_link.commands import Command
from web.body import Body
from web.view.cameras import Camera
from web.view.options import Signal


class CommandBody(Body):
    request_id: str | None = Field(
        None, min_length=1, max_length=64, description="the same id again is the same command"
    )

    @property
    def fields(self) -> dict[str, Any]:
        """Return the fields of the command; without a request id if the page sent none."""
        return {name: value for name, value in self if name != "request_id" or value}


def body_of(command: Command) -> type[CommandBody]:
    """Return the body of a command: the fields of its request without the requester."""
    carried: dict[str, Any] = {
        field.name: (field.type, ... if field.required else field.default_factory())
        for field in fields_of(command.request)
        if field.name not in ("request_id", "requester")
    }
    return create_model(f"{command.request.__name__}Body", __base__=CommandBody, **carried)


class InvitationBody(Body):
    role: Literal["operator", "viewer"] = "viewer"


class CameraBody(Body):
    view: str = Field(min_length=1, max_length=64, description="the page's own name of its view")
    camera: Camera | None = None
    shadows: bool | None = None


class ViewBody(Body):
    """Change of what the 3D view shows; omitted fields keep their values."""

    flown: bool | None = Field(None, description="the path of the estimate")
    reference: bool | None = Field(None, description="its path and present point")
    truth: bool | None = Field(None, description="ghost of the simulator's or tracker's truth")
    volume: bool | None = Field(None, description="flight volume")
    ground: bool | None = Field(None, description="grid and axes")
    error: bool | None = Field(None, description="vector from the estimate to the reference")
    magnified: int | None = Field(None, ge=1, le=100, description="of the error vector")
    color: Signal | None = Field(None, description="signal that colours the flown path")
