"""Previews come from one helper process, which is started again when it has ended."""

from __future__ import annotations

import asyncio

import pytest

from quadrotor.errors import OutOfBoundsError
from web.commands.previewer import Previewer

HERE = (0.0, 0.0, 1.0, 0.0)


def test_previews_share_a_process_and_an_ended_one_is_replaced() -> None:
    previewer = Previewer()

    def ask(radius: float) -> float:
        arguments = {"trajectory": "circle", "laps": 1, "period": 8.0, "radius": radius}
        return asyncio.run(previewer.preview(HERE, arguments, {}, None)).duration

    try:
        assert ask(0.5) == pytest.approx(11.0)
        first = previewer._job
        with pytest.raises(OutOfBoundsError, match="radius = 99"):
            ask(99.0)
        assert ask(0.6) == pytest.approx(11.0)
        assert previewer._job is first is not None
        first.stop()
        assert ask(0.7) == pytest.approx(11.0)
        assert previewer._job is not first
    finally:
        previewer.stop()
    assert previewer._job is None
