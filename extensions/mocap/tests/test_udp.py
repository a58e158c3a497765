"""Lines over UDP: what is a frame, and what is refused with the form of a line."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.mocap.udp import LARGEST_NS, parse
from quadrotor.errors import MeasurementError


def test_lines_are_the_bodies_of_one_frame_with_the_stamp_of_any_clock() -> None:
    frame = parse(b"12.5,quad1,1,2,3,1,0,0,0\n12.5,wand,4,5,6\n", 7)
    assert (frame.stamp_ns, frame.received_ns) == (12_500_000_000, 7)
    body, marker = frame.bodies
    np.testing.assert_array_equal(body.position_w, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(marker.position_w, (4.0, 5.0, 6.0))
    assert marker.quaternion_wb is None
    assert parse(b",quad1,1,2,3", 7).stamp_ns is None


@pytest.mark.parametrize(
    "stamp", ["1e30", "-1e30", f"{(LARGEST_NS + 2**11) / 1e9!r}", "inf", "nan", "noon"]
)
def test_a_stamp_that_no_clock_has_is_refused(stamp: str) -> None:
    with pytest.raises(MeasurementError, match=r"an invalid line: .* the stamp in s"):
        parse(f"{stamp},quad1,1,2,3,1,0,0,0".encode(), 7)


@pytest.mark.parametrize(
    "line", ["", "hello", "1,quad1,1,2", "1,,1,2,3", "1,quad1,1,2,three", "1,\x1b[31mquad1,1,2,3"]
)
def test_a_line_of_another_form_is_refused_or_no_body(line: str) -> None:
    if line:
        with pytest.raises(MeasurementError, match="send stamp,name,x,y,z"):
            parse(line.encode(), 7)
    else:
        assert parse(b"", 7).bodies == ()
