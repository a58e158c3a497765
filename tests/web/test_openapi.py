"""The API as its own description gives it: whatever is sent, no answer is a defect of ours.

Requests are made by schemathesis from /api/openapi.json, sound ones and broken ones, as an admin.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis.errors import Unsatisfiable

from console.catalogue.catalogue import Catalogue

schemathesis = pytest.importorskip("schemathesis", reason="schemathesis is not installed")


@schemathesis.serializer("application/toml", "text/plain", "text/csv")
def as_text(_: Any, value: Any) -> bytes:
    """Files of parameters and beacons, sound or not."""
    return value if isinstance(value, bytes) else str(value).encode()


EXAMPLES = 2  # of each route and kind
NOT_ASKED = ("/api/session/sign_out", "/api/trajectories/preview")
"""One ends the session the others are asked with, one takes a process each time."""
SOUND = schemathesis.GenerationMode.POSITIVE


def can_be_wrong(operation: Any) -> bool:
    """Return whether something of a request is described closer than as a text; else every request
    is sound, and schemathesis tries hundreds of times before it says so."""
    described = [set(one.definition.get("schema", ())) for one in operation.path_parameters]
    return bool(operation.query or operation.body or any(d - {"type", "title"} for d in described))


@pytest.fixture
def own_site(serve: Any, tmp_path: Path) -> Iterator[Any]:
    """One that nobody else needs: requests delete and change what they hit."""
    with serve(tmp_path, Catalogue(tmp_path)) as running:
        yield running


def test_no_request_makes_the_server_fail(own_site: Any) -> None:
    site = own_site
    with site.sign_in() as admin:
        headers = {"Cookie": site.cookie(admin), "Origin": site.base}
    schema = schemathesis.openapi.from_url(f"{site.base}/api/openapi.json", headers=headers)
    statuses: dict[str, set[int]] = {}

    def ask(case: Any) -> None:
        answer = case.call(headers=headers, timeout=20.0)
        statuses.setdefault(case.operation.label, set()).add(answer.status_code)
        assert answer.status_code < 500 or answer.status_code == 503, answer.text
        if answer.status_code >= 400 and answer.content:
            assert answer.json()["error"].count("\n") == 0

    for found in schema.get_all_operations():
        operation = found.ok()
        if operation.path in NOT_ASKED:
            continue
        modes = tuple(schemathesis.GenerationMode) if can_be_wrong(operation) else (SOUND,)
        for mode in modes:
            attempt = given(case=operation.as_strategy(generation_mode=mode))(
                lambda case: ask(case)
            )
            with contextlib.suppress(Unsatisfiable):  # a body of any text: none is wrong
                settings(
                    max_examples=EXAMPLES,
                    deadline=None,
                    derandomize=True,
                    database=None,
                    suppress_health_check=list(HealthCheck),
                    phases=(Phase.generate,),
                )(attempt)()
    print({label: sorted(seen) for label, seen in statuses.items()})
    assert len(statuses) > 30
    assert not any(401 in seen or 403 in seen for seen in statuses.values()), statuses
