"""Routes below /api/checklist."""

from __future__ import annotations

from typing import Annotated

from fastapi import FastAPI
from pydantic import Field

from extensions.checklist.store import LONGEST, MOST, ChecklistStore
from quadrotor.json_object import JsonObject
from web.access.requester import Operator
from web.body import Body
from web.feature import Feature
from web.vehicle_context import VehicleContext

Text = Annotated[str, Field(min_length=1, max_length=LONGEST)]


class ItemsBody(Body):
    items: list[Text] = Field(max_length=MOST)


class TickBody(Body):
    item: Text
    done: bool


def add_checklist(app: FastAPI, context: VehicleContext) -> None:
    store = ChecklistStore(context.catalogue.folder.parent)

    def items() -> list[JsonObject]:
        return [
            {"text": one.text, **(one.tick.model_dump() if one.tick else {"by": "", "stamp": None})}
            for one in store.items()
        ]

    @app.get("/api/checklist")
    def checklist() -> list[JsonObject]:
        """Return the items, each with who ticked it today and when (s, epoch)."""
        return items()

    @app.put("/api/checklist")
    def write(body: ItemsBody, _: Operator) -> list[JsonObject]:
        """Replace the items, for all pages and days; return them."""
        store.write(body.items)
        return items()

    @app.post("/api/checklist/tick")
    def tick(body: TickBody, session: Operator) -> list[JsonObject]:
        """Tick an item for this day, or take its tick back; return the items."""
        store.tick(body.item, session.label, done=body.done)
        return items()


FEATURE = Feature(add_checklist)
