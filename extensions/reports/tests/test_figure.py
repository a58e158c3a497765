"""A chart's SVG becomes a PDF of the same width, whose fonts are embedded."""

from __future__ import annotations

import base64
import io
import re
import zlib

import numpy as np
import pytest
from matplotlib.image import imsave

from extensions.reports.figure import as_pdf, color_of, path_of
from quadrotor.errors import UsageError


def chart(content: str, width: str = "88mm") -> bytes:
    size = 'viewBox="0 0 332 186"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" {size}>{content}</svg>'.encode()
    )


def picture() -> str:
    written = io.BytesIO()
    imsave(written, np.zeros((2, 2, 3)), format="png")
    return base64.b64encode(written.getvalue()).decode()


CONTENT = f"""<rect x="0" y="0" width="332" height="186" fill="rgb(255, 255, 255)"/>
<clipPath id="c0"><path d="M10 10h300v150h-300z"/></clipPath>
<g transform="translate(10 26)"><path d="M0 0L100 50L200 20" fill="none"
stroke="color(srgb 0.1 0.2 0.3)"
stroke-width="1.4" stroke-dasharray="5 4" clip-path="url(#c0)"/>
<text x="5" y="9" fill="rgb(1, 2, 3)" style="font: 600 11px system-ui" text-anchor="middle"
dominant-baseline="central" transform="matrix(0 -1 1 0 4 60)">Position $ [m] – µ</text></g>
<image x="1" y="1" width="9" height="9" href="data:image/png;base64,{picture()}" opacity="0.5"/>"""


def test_a_chart_has_its_width_on_paper_and_embedded_true_type_fonts() -> None:
    pdf = as_pdf(chart(CONTENT))
    assert pdf.startswith(b"%PDF")
    box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", pdf)
    assert box is not None
    assert float(box[1]) == pytest.approx(88 / 25.4 * 72, abs=0.01)
    assert float(box[2]) == pytest.approx(88 / 25.4 * 72 * 186 / 332, abs=0.01)
    assert pdf.count(b"/FontFile2") >= 1, "whole TrueType"
    assert b"/Subtype /Type3" not in pdf


def test_lines_have_their_width_in_points() -> None:
    pdf = as_pdf(chart('<path d="M0 0L9 9" fill="none" stroke="#123456" stroke-width="4"/>'))
    drawn = b"".join(
        zlib.decompress(found)
        for found in re.findall(rb"FlateDecode >>\s*stream\r?\n(.*?)\r?\nendstream", pdf, re.S)
    )
    widths = {round(float(one), 3) for one in re.findall(rb"([\d.]+) w\b", drawn)}
    assert round(4 * 88 / 25.4 * 72 / 332, 3) in widths


def test_steps_of_paths_and_colours_are_those_of_the_page() -> None:
    circle = np.asarray(path_of("M2 5a3 3 0 1 0 6 0a3 3 0 1 0 -6 0").vertices, float)
    assert circle[0].tolist() == [2.0, 5.0]
    assert np.hypot(*(circle - (5.0, 5.0)).T) == pytest.approx(3.0)
    assert circle[-1] == pytest.approx([2.0, 5.0])
    assert color_of("rgba(255, 0, 51, 0.5)") == pytest.approx((1.0, 0.0, 0.2, 0.5))
    assert color_of("color(srgb 1 0 0.2 / 0.5)") == pytest.approx((1.0, 0.0, 0.2, 0.5))


@pytest.mark.parametrize(
    ("svg", "line"),
    [
        (b"no svg", "no chart of the page"),
        (chart("", "332"), None),
        (chart("", "wide"), "width in mm"),
        (chart("", "5000mm"), "5000 mm wide, of .* units; allowed are up to 1000 mm"),
        (b'<svg width="88mm" viewBox="0 0 1 11"/>', "1 by 11 units; .* up to 10 widths of height"),
        (b'<svg width="88mm" viewBox="0 0 1 inf"/>', "1 by inf units"),
        pytest.param(chart("<g>" * 5000 + "</g>" * 5000), "maximum recursion depth", id="nested"),
        (b'<!DOCTYPE x [<!ENTITY a "b">]><svg/>', "document type"),
        (chart('<image href="http://elsewhere/x.png"/>'), "image is not understood"),
        (chart("<script>1</script>"), "script is not understood"),
        (chart('<path d="Q1 2 3 4"/>'), "path 'Q1 2 3 4' is not understood"),
        (chart('<path d="M1" fill="none"/>'), "no chart of the page"),
        (chart('<rect fill="url(#x)"/>'), "colour 'url"),
    ],
)
def test_what_is_no_chart_is_refused_in_one_line(svg: bytes, line: str | None) -> None:
    if line is None:
        assert as_pdf(svg).startswith(b"%PDF")
        return
    with pytest.raises(UsageError, match=line) as refused:
        as_pdf(svg)
    assert "\n" not in str(refused.value)
