"""A report as one HTML file: no network, no scripts, every text escaped."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from html import escape
from io import BytesIO
from typing import Any

from console.plots import STYLE
from console.reports.content import Heading, Picture, Report, Table, Text

GENERATOR = "quadlab report"
LARGEST_SVG = 1_000_000
"""Size in bytes above which a figure becomes a bitmap of twice the page's resolution."""
STYLE_SHEET = """
:root { color-scheme: light; }
body { max-width: 60rem; margin: 2rem auto; padding: 0 1.25rem; background: #fff; color: #1c1c1c;
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .2rem; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; padding-top: .6rem; border-top: 1px solid #ddd; }
p { margin: .5rem 0; overflow-wrap: anywhere; }
.subtitle { color: #555; margin: 0 0 .9rem; }
.verdict { display: inline-block; margin: .2rem .8rem .2rem 0; padding: .15rem .7rem;
  border: 1px solid; border-radius: .3rem; font-weight: 600; }
.passed { color: #00563f; background: #e8f5f0; }
.failed { color: #8c2d04; background: #fdeee6; }
.not_judged, .none { color: #444; background: #f2f2f2; }
.why { color: #555; }
.warning { border-left: 4px solid #d55e00; padding: .25rem .75rem; background: #fdf3ec; }
.facts { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1.2rem; margin: 1rem 0; }
.facts dt { color: #555; } .facts dd { margin: 0; overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; margin: .4rem 0 1.1rem; font-size: .9rem; }
caption, summary { text-align: left; font-weight: 600; padding: .3rem 0; }
summary { cursor: pointer; font-size: .9rem; }
th { text-align: left; font-weight: 500; color: #555; border-bottom: 1px solid #999; }
th, td { padding: .2rem .7rem .2rem 0; vertical-align: top; overflow-wrap: anywhere; }
td { border-bottom: 1px solid #eee; }
.n { text-align: right; font-variant-numeric: tabular-nums; padding-right: 1.8rem; }
.bad { color: #8c2d04; font-weight: 600; }
figure { margin: 1.2rem 0 1.8rem; } figure img { width: 100%; height: auto; display: block; }
figcaption { color: #444; font-size: .9rem; margin-top: .3rem; }
.scroll { overflow-x: auto; }
@media print { body { margin: 0; max-width: none; font-size: 10pt; }
  figure, tr { break-inside: avoid; } h2, caption { break-after: avoid; } }
"""
WORDS = {"passed": "✓ passed", "failed": "✗ failed", "not_judged": "– not judged", "": "not judged"}
LOUD = ("EXCEEDED", "WARNING")


def render(report: Report) -> Iterator[str]:
    """Yield the parts of the page; each figure is drawn when it is reached."""
    verdict = report.verdict if report.verdict in WORDS else ""
    facts = "".join(f"<dt>{escape(n)}</dt><dd>{escape(v)}</dd>" for n, v in report.facts)
    yield (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta name="generator" content="{GENERATOR}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "img-src data:; style-src 'unsafe-inline'\">\n"
        f"<title>{escape(report.title)}</title>\n<style>{STYLE_SHEET}</style>\n</head>\n"
        f"<body>\n<main>\n<h1>{escape(report.title)}</h1>\n"
        f'<p class="subtitle">{escape(report.subtitle)}</p>\n'
        f'<p><span class="verdict {verdict or "none"}">{WORDS[verdict]}</span>'
        f'<span class="why">{escape(report.verdict_reason)}</span></p>\n'
        f'<dl class="facts">{facts}</dl>\n'
    )
    number = 0
    for block in report.blocks:
        if isinstance(block, Heading):
            yield f"<h2>{escape(block.text)}</h2>\n"
        elif isinstance(block, Text):
            kind = ' class="warning"' if block.warning else ""
            yield f"<p{kind}>{escape(block.text)}</p>\n"
        elif isinstance(block, Table):
            yield _table(block)
        else:
            number += 1
            yield (
                f'<figure><img alt="{escape(block.description)}" src="{_picture(block)}">'
                f"<figcaption><strong>{number}. {escape(block.title)}.</strong> "
                f"{escape(block.caption)}{_link(block)}</figcaption></figure>\n"
            )
    yield "</main>\n</body>\n</html>\n"


def _table(table: Table) -> str:
    def cell(tag: str, column: int, text: str) -> str:
        names = ["n"] if column in table.numeric else []
        names += ["bad"] if text in LOUD else []
        kind = f' class="{" ".join(names)}"' if names else ""
        scope = ' scope="col"' if tag == "th" else ""
        return f"<{tag}{kind}{scope}>{escape(text)}</{tag}>"

    def row(tag: str, cells: Any) -> str:
        return f"<tr>{''.join(cell(tag, k, str(text)) for k, text in enumerate(cells))}</tr>\n"

    title = escape(table.title)
    caption = f"<caption>{title}</caption>" if title and not table.folded else ""
    rows = "".join(row("td", one) for one in table.rows)
    columns = "".join(f'<col style="width:{100 * one:.0f}%">' for one in table.widths)
    made = (
        f'<div class="scroll"><table>{caption}<colgroup>{columns}</colgroup>'
        f"<thead>{row('th', table.head)}</thead>\n"
        f"<tbody>{rows}</tbody></table></div>\n"
    )
    return f"<details><summary>{title}</summary>{made}</details>\n" if table.folded else made


def _link(picture: Picture) -> str:
    link = picture.link
    return f' <a href="{escape(link)}" target="_top">Open in replay</a>' if link else ""


def _picture(picture: Picture) -> str:
    """Return the figure as a data URL."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        kind, made = "svg+xml", BytesIO()
        about = {"Date": None, "Creator": None}
        picture.figure.savefig(made, format="svg", dpi=100, metadata=about)
        if made.tell() > LARGEST_SVG:
            kind, made = "png", BytesIO()
            picture.figure.savefig(made, format="png", dpi=2 * 96 * 1.25)
    return f"data:image/{kind};base64,{base64.b64encode(made.getvalue()).decode()}"
