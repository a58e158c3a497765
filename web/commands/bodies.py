"""The requests of a page to the vehicle: the bodies of `POST /api/commands/…`."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    request_id: str | None = Field(
        None, min_length=1, max_length=64, description="the same id again is the same command"
    )

    @property
    def fields(self) -> dict[str, str]:
        """The request's own id, if the page gave one."""
        return {"request_id": self.request_id} if self.request_id else {}


class CommandBody(_Body):
    """arm, disarm."""


class StartBehaviorBody(_Body):
    name: str = Field(min_length=1, max_length=64)
    arguments: dict[str, bool | int | float | str] = {}


class EmergencyBody(_Body):
    action: Literal["land", "cut"]


class RecordBody(_Body):
    start: bool


class SimulationBody(_Body):
    action: Literal["swap_battery", "reset"]


class InvitationBody(BaseModel):
    model_config = ConfigDict(extra="forbid")

    role: Literal["operator", "viewer"] = "viewer"


class FollowBody(BaseModel):
    model_config = ConfigDict(extra="forbid")

    view: str = Field(min_length=1, max_length=64)
    follow: bool
