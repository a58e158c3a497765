"""A replay as files that need no server: the page with everything in it, and the run beside it.

The page's modules are joined as the web process joins them, with `replay/exported.js` in place of
`core/api.js`: the page asks as ever, and that module answers from `run.js`.
"""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
from quadrotor.errors import StorageError, UsageError
from web.joined_files import join_modules, join_styles
from web.static_files import STATIC
from web.uplot import read_uplot

POINTS = 10_000
"""A topic with more than twice as many samples is kept as least and greatest of this many bins."""
TOGETHER = 64
"""Signals in one piece of text."""
OURS = "extensions/replay/"
PAGE = Path(__file__).parent / "page"
API, EXPORTED = "core/api.js", f"{OURS}replay/exported.js"
_STYLE = re.compile(r'<link rel="stylesheet" href="/(static|vendor)/([^"]+)">\n?')
_SERVED = re.compile(r'<(?:link rel="icon"|form id="plain-emergency"|script ).*\n')


def export_page(
    log: Path, folder: Path, progress: Callable[[float], None], derived: Sequence[str] = ()
) -> list[Path]:
    """Write `index.html` and `run.js` into a new or empty folder and return them.

    Args:
        derived: expressions of signals that the page gets beside those of the log.

    Raises UsageError for a folder with something in it or a wrong expression, LogFormatError or
    StorageError.
    """
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise UsageError(
                f"{folder} is not empty; export into a new folder, nothing is overwritten"
            )
        build_replay(log, lambda share: progress(0.8 * share))
        replay = Replay(log)
        texts = {"run.js": _run(replay, log.stem, derived), "index.html": _page(log.stem)}
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise StorageError(
            f"cannot write into {folder}: {error.strerror}; choose a new folder with --out"
        ) from error
    return [folder / "index.html", folder / "run.js"]


def _run(replay: Replay, name: str, derived: Sequence[str]) -> str:
    """Return the run as a script: description, track, and the columns that change."""
    described = replay.described()
    for signal in replay.expressions(derived):
        if "problem" in signal:
            raise UsageError(f"--derive {signal['name']!r}: {signal['problem']}")
        described["signals"].append(signal)
    topics = described["topics"].items()
    pictured = {topic for topic, about in topics if about["type"].endswith("CompressedImage")}
    kept, timed = [], set()
    for signal in described["signals"]:
        # A topic without a number that changes gives one column for its times.
        if "constant" not in signal:
            kept.append(signal["name"])
            timed.add(signal["topic"])
    for signal in described["signals"]:
        if signal["topic"] not in timed | pictured:
            kept.append(signal["name"])
            timed.add(signal["topic"])
    duration = described["duration"]
    windows = [
        _text(replay.window(kept[k : k + TOGETHER], 0.0, duration, POINTS))
        for k in range(0, len(kept), TOGETHER)
    ]
    description: dict[str, object] = {
        **described,
        "state": "ready",
        "id": name,
        "is_growing": False,
        "is_current": True,
        "vehicle": described["namespace"].strip("/"),
        "topics": {topic: about for topic, about in topics if topic not in pictured},
    }
    content = {"description": description, "track": _text(replay.track[:]), "windows": windows}
    return f"globalThis.quadlabRun = {json.dumps(content, separators=(',', ':'))};\n"


def _page(name: str) -> str:
    """Return the page with its styles and scripts in it."""

    def read(file: str) -> str:
        file = EXPORTED if file == API else file
        place = PAGE / file.removeprefix(OURS) if file.startswith(OURS) else STATIC / file
        return place.read_text(encoding="utf-8")

    page = read(f"{OURS}replay/replay.html")
    sheets = [
        join_styles([file], read) if place == "static" else read_uplot(file).decode()
        for place, file in _STYLE.findall(page)
    ]
    joined = join_modules(f"{OURS}replay/replay.js", read, "", "").text
    code = joined.rpartition("//# sourceMappingURL")[0]
    scripts = [read_uplot("uPlot.iife.js").decode(), None, code]
    tags = [
        f"<script>\n{_inside(one)}</script>\n" if one else '<script src="run.js"></script>\n'
        for one in scripts
    ]
    tags[-1] = tags[-1].replace("<script>", '<script type="module">', 1)
    page = _SERVED.sub("", _STYLE.sub("", page))
    page = page.replace("</head>", f"<style>\n{''.join(sheets)}</style>\n{''.join(tags)}</head>")
    shown = html.escape(name, quote=True)
    return page.replace(
        '<body class="page replay">', f'<body class="page replay" data-run="{shown}">'
    )


def _inside(code: str) -> str:
    """Return code that does not end the element that it stands in."""
    return code.replace("</script", r"<\/script")


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()
