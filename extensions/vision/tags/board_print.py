"""A ChArUco board to be printed: a PDF page of the true size, with rulers to check the print.

The file follows "Document management: portable document format 1.7", ISO 32000-1 (2008).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from extensions.vision.tags.charuco import BOARD_FAMILY, Board
from extensions.vision.tags.detector import dictionary_of
from quadrotor.errors import MeasurementError

PAPERS = {"A4": (297, 210), "A3": (420, 297), "A2": (594, 420), "A1": (841, 594), "A0": (1189, 841)}
"""Width and height of a page on its side, mm."""
SIDE, TOP, BELOW = 22.0, 9.0, 24.0
"""Room left and right of the board, above it, and below it for ruler and text; mm."""
RULER = 100
"""Length of the rulers, mm."""
POINTS_PER_MM = 72.0 / 25.4

Rectangle = tuple[float, float, float, float]
"""Left, bottom, width and height on the page, mm."""


def board_pdf(board: Board) -> str:
    """Return a PDF of the board on the smallest paper, as text of Latin-1.

    Raises MeasurementError for a board that is larger than A0.
    """
    wide, high = (1e3 * side for side in board.size)
    name, (width, height) = _paper(wide, high)
    left, bottom = 0.5 * (width - wide), height - TOP - high
    text = (
        f"quadlab: ChArUco board, {board.columns} x {board.rows} squares of "
        f"{1e3 * board.square:g} mm, markers of {1e3 * board.marker:g} mm, DICT_{BOARD_FAMILY}, "
        f"{name}"
    )
    advice = (
        "Print it at 100 % (actual size), without fitting to the page. Both rulers must be "
        f"{RULER} mm long. Glue it to something flat and stiff."
    )
    drawn = [
        f"{POINTS_PER_MM:.6f} 0 0 {POINTS_PER_MM:.6f} 0 0 cm",
        *(
            f"{x:.4f} {y:.4f} {w:.4f} {h:.4f} re"
            for x, y, w, h in _black(board, left, bottom + high)
        ),
        "f",
        "0.2 w",
        *_ruler(left, bottom - 6.0, 1, 0),
        *_ruler(left - 8.0, bottom, 0, 1),
        f"BT /F1 3.2 Tf {left + RULER + 6:.2f} {bottom - 7:.2f} Td ({RULER} mm) Tj ET",
        f"BT /F1 3.2 Tf {left:.2f} {bottom - 13:.2f} Td ({_escaped(text)}) Tj ET",
        f"BT /F1 3.2 Tf {left:.2f} {bottom - 17.5:.2f} Td ({_escaped(advice)}) Tj ET",
    ]
    return _document("\n".join(drawn), width * POINTS_PER_MM, height * POINTS_PER_MM)


def _paper(wide: float, high: float) -> tuple[str, tuple[int, int]]:
    for name, (long, short) in PAPERS.items():
        width, height = (long, short) if wide >= high else (short, long)
        if wide + 2.0 * SIDE <= width and high + TOP + BELOW <= height:
            return name, (width, height)
    raise MeasurementError(
        f"a board of {wide:.0f} x {high:.0f} mm is larger than A0; use smaller squares"
    )


def _black(board: Board, left: float, top: float) -> Iterator[Rectangle]:
    """Yield what is black of a board whose upper left corner is there."""
    import cv2

    dictionary, charuco = dictionary_of(BOARD_FAMILY), board.of_opencv()
    square, with_marker = 1e3 * board.square, set()
    for number, corners in zip(
        np.ravel(charuco.getIds()).tolist(), charuco.getObjPoints(), strict=True
    ):
        x, y = 1e3 * np.array(corners)[0, :2]
        with_marker.add((int(x // square), int(y // square)))
        count = dictionary.markerSize + 2
        cell = 1e3 * board.marker / count
        picture = cv2.aruco.generateImageMarker(dictionary, number, count)
        for row, column in np.argwhere(np.asarray(picture) == 0):
            yield left + x + column * cell, top - y - (row + 1) * cell, cell, cell
    for row in range(board.rows):
        for column in range(board.columns):
            if (column, row) not in with_marker:
                yield left + column * square, top - (row + 1) * square, square, square


def _ruler(x: float, y: float, right: int, up: int) -> Iterator[str]:
    yield f"{x:.3f} {y:.3f} m {x + RULER * right:.3f} {y + RULER * up:.3f} l S"
    for k in range(0, RULER + 1, 10):
        tick = 3.0 if k in (0, RULER) else 1.5
        a, b = x + k * right, y + k * up
        yield f"{a:.3f} {b:.3f} m {a - tick * up:.3f} {b - tick * right:.3f} l S"


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")


def _document(content: str, width: float, height: float) -> str:
    bodies = [
        "<< /Type /Catalog /Pages 2 0 R >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.3f} {height:.3f}] "
        "/Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
        f"<< /Length {len(content)} >>\nstream\n{content}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    text, places = "%PDF-1.4\n", []
    for number, body in enumerate(bodies, 1):
        places.append(len(text))
        text += f"{number} 0 obj\n{body}\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    return (
        f"{text}xref\n0 {len(bodies) + 1}\n0000000000 65535 f \n{table}"
        f"trailer\n<< /Size {len(bodies) + 1} /Root 1 0 R >>\nstartxref\n{len(text)}\n%%EOF\n"
    )
