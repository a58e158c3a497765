"""A chart's SVG as a PDF for print: of the page's width on paper, with its fonts embedded.

The SVG is one that the page records while it draws a chart (`web/static/charts/svg.js`); only what
that writes is understood.
"""

from __future__ import annotations

import base64
import io
import math
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D, Transform

MILLIMETRES, POINTS = 25.4, 72.0
"""Millimetres and points in an inch."""
WIDEST, TALLEST = 1000.0, 10.0
"""Widest figure, in mm, and the largest height, in widths."""
SVG = "{http://www.w3.org/2000/svg}"
_STEP = re.compile(r"([MLhvaz])([^MLhvaz]*)")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
_FONT = re.compile(r"font: (.*?)([\d.]+)px")
_DATA = "data:image/png;base64,"
_ALIGNED = {"": "left", "middle": "center", "end": "right"}
_BASE = {"text-before-edge": "top", "central": "center", "text-after-edge": "bottom"}


def as_pdf(svg: bytes) -> bytes:
    """Return the PDF of a chart's SVG. Raises UsageError for anything else."""
    if b"<!" in svg:
        raise UsageError("this is no chart of the page: it has a document type or comments")
    try:
        root = ElementTree.fromstring(svg)
        width = float(root.get("width", "").removesuffix("mm"))
        _, _, across, down = (float(one) for one in root.get("viewBox", "").split())
    except (ElementTree.ParseError, ValueError) as error:
        raise UsageError(f"this is no chart of the page with a width in mm: {error}") from error
    if not (0.0 < width <= WIDEST and across > 0.0 and 0.0 < down <= TALLEST * across):
        raise UsageError(
            f"the figure is {width:g} mm wide, of {across:g} by {down:g} units; allowed are up to "
            f"{WIDEST:g} mm, and up to {TALLEST:g} widths of height"
        )
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    inches = width / MILLIMETRES
    with rc_context({"pdf.fonttype": 42, "path.simplify": False}):  # TrueType, whole
        figure = Figure(figsize=(inches, inches * down / across))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set(xlim=(0.0, across), ylim=(down, 0.0))
        try:
            _Sheet(axes, inches * POINTS / across).draw(root)
        except (ValueError, KeyError, IndexError, RecursionError) as error:
            raise UsageError(f"this is no chart of the page: {error}") from error
        written = io.BytesIO()
        figure.savefig(written, format="pdf")
    return written.getvalue()


class _Sheet:
    """The axes on which the elements are drawn, in the SVG's own units.

    Args:
        points: points on paper of one unit.
    """

    def __init__(self, axes: Axes, points: float) -> None:
        self._axes, self._points = axes, points
        self._clips: dict[str, Path] = {}

    def draw(self, root: ElementTree.Element) -> None:
        """Draw all elements, each above the elements before it."""
        from matplotlib.transforms import Affine2D

        self._draw(root, Affine2D())

    def _draw(self, parent: ElementTree.Element, moved: Transform) -> None:
        for one in parent:
            kind, place = one.tag.removeprefix(SVG), _placed(one.get("transform", "")) + moved
            if kind == "g":
                self._draw(one, place)
            elif kind == "clipPath":
                self._clips[f"url(#{one.get('id')})"] = path_of(one[0].get("d", ""))
            else:
                made = {"path": self._path, "rect": self._rect, "text": self._text}.get(kind)
                self._add((made or self._image)(one, place), one, moved)

    def _add(self, artist: Artist, one: ElementTree.Element, moved: Transform) -> None:
        artist.set_zorder(len(self._axes.get_children()))
        artist.set_alpha(float(one.get("opacity", 1.0)) * (artist.get_alpha() or 1.0))
        if clip := one.get("clip-path"):
            artist.set_clip_path(self._clips[clip], moved + self._axes.transData)
        else:
            artist.set_clip_on(False)

    def _path(self, one: ElementTree.Element, place: Transform) -> Artist:
        from matplotlib.patches import PathPatch

        patch = PathPatch(
            path_of(one.get("d", "")),
            facecolor=color_of(one.get("fill", "none")),
            edgecolor=color_of(one.get("stroke", "none")),
            linewidth=float(one.get("stroke-width", 0.0)) * self._points,
            transform=place + self._axes.transData,
        )
        if dashes := [
            float(n) * self._points for n in _NUMBER.findall(one.get("stroke-dasharray", ""))
        ]:
            width = patch.get_linewidth() or 1.0  # matplotlib scales dashes by it
            patch.set_linestyle((0.0, [length / width for length in dashes]))
        return self._axes.add_patch(patch)

    def _rect(self, one: ElementTree.Element, place: Transform) -> Artist:
        from matplotlib.patches import Rectangle

        x, y, width, height = (float(one.get(name, 0.0)) for name in ("x", "y", "width", "height"))
        color, to = color_of(one.get("fill", "none")), place + self._axes.transData
        return self._axes.add_patch(
            Rectangle((x, y), width, height, color=color, lw=0, transform=to)
        )

    def _text(self, one: ElementTree.Element, place: Transform) -> Artist:
        font = _FONT.search(one.get("style", ""))
        style, size = (font[1], float(font[2])) if font else ("", 11.0)
        (x, y), turn = place.transform((float(one.get("x", 0.0)), float(one.get("y", 0.0)))), place
        (a, b) = turn.get_matrix()[:2, 0]
        return self._axes.text(
            float(x),
            float(y),
            one.text or "",
            fontsize=size * self._points,
            fontweight="bold" if "bold" in style or "600" in style else "normal",
            color=color_of(one.get("fill", "none")),
            ha=_ALIGNED[one.get("text-anchor", "")],
            va=_BASE.get(one.get("dominant-baseline", ""), "baseline"),
            rotation=-math.degrees(math.atan2(b, a)),
            rotation_mode="anchor",
            parse_math=False,
        )

    def _image(self, one: ElementTree.Element, place: Transform) -> Artist:
        from matplotlib.image import imread

        data = one.get("href", "")
        if not data.startswith(_DATA):
            raise ValueError(f"the element {one.tag.removeprefix(SVG)} is not understood")
        x, y, width, height = (float(one.get(name, 0.0)) for name in ("x", "y", "width", "height"))
        return self._axes.imshow(
            np.asarray(imread(io.BytesIO(base64.b64decode(data.removeprefix(_DATA))))),
            extent=(x, x + width, y + height, y),
            aspect="auto",
            transform=place + self._axes.transData,
        )


def _placed(transform: str) -> Affine2D:
    from matplotlib.transforms import Affine2D

    numbers = [float(one) for one in _NUMBER.findall(transform)]
    if transform.startswith("matrix"):
        return Affine2D.from_values(*numbers)
    return Affine2D().translate(*numbers) if numbers else Affine2D()


def path_of(text: str) -> Path:
    """Return the path of an SVG's `d`. Raises ValueError for steps that the page does not write."""
    from matplotlib.path import Path

    if not re.fullmatch(r"[MLhvaz\d\s.e-]*", text):
        raise ValueError(f"the path {text!r:.60} is not understood")
    points, codes = [np.zeros(2)], [Path.MOVETO]
    for point, code in _steps(text):
        points.append(points[-1] if point is None else point)
        codes.append(code)
    return Path(np.array(points[1:] or points), codes[1:] or codes)


def _steps(text: str) -> Iterator[tuple[np.ndarray | None, np.uint8]]:
    from matplotlib.path import Path

    at = np.zeros(2)
    for letter, given in _STEP.findall(text):
        numbers = [float(one) for one in _NUMBER.findall(given)]
        if letter == "z":
            yield None, Path.CLOSEPOLY
        elif letter == "a":  # half of a circle, from left to right and back
            radius, side = numbers[0], math.copysign(1.0, numbers[5])
            for turn in math.pi * (1.0 - np.arange(1, 17) / 16.0):
                offset = np.array([radius * math.cos(turn) + radius, -radius * math.sin(turn)])
                yield at + side * offset, Path.LINETO
            at = at + np.array([numbers[5], numbers[6]])
        else:
            step = {"h": (numbers[0], 0.0), "v": (0.0, numbers[0])}.get(letter)
            at = np.array(numbers[:2]) if step is None else at + step
            yield at, Path.MOVETO if letter == "M" else Path.LINETO


def color_of(text: str) -> str | tuple[float, ...]:
    """Return a colour as the browser writes it, for matplotlib. Raises ValueError."""
    if text in ("", "none", "transparent"):
        return "none"
    if text.startswith("#"):
        return text
    numbers = [float(one) for one in _NUMBER.findall(text)]
    if len(numbers) not in (3, 4) or not text.startswith(("rgb", "color(srgb")):
        raise ValueError(f"the colour {text!r:.40} is not understood")
    scale = 255.0 if text.startswith("rgb") else 1.0
    red, green, blue = (min(1.0, max(0.0, one / scale)) for one in numbers[:3])
    return red, green, blue, *numbers[3:]
