"""Panels of extensions: their elements in the page's documents, and their files.

A document has a comment `<!-- place: NAME -->` where panels of that place stand. The place "tabs"
has those of the console; the buttons of all tabs, also of the built-in ones, are made here.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from quadrotor.extension import PageDocument, PagePanel
from web.joined_files import PanelScript

FOLDER = "extensions/"
"""Folder, among the page's files, of those of extensions."""
TABS = {
    "fly": "Fly",
    "experiments": "Experiments",
    "gains": "Gains",
    "beacons": "Beacons",
    "calibrate": "Calibrate",
    "link": "Link",
}
"""The built-in tabs of the console and their labels."""
TAKEN = (*TABS, "charts")
"""Names that no panel can have."""
_PLACE = re.compile(r"^[ ]*<!-- place: (\w+) -->\n", re.MULTILINE)
_BUTTONS = re.compile(r"^([ ]*)<!-- tabs -->\n", re.MULTILINE)


@dataclass(frozen=True)
class Panel:
    """A panel that an extension offers.

    Attributes:
        folder: the folder `page` of the extension.
    """

    offer: PagePanel
    extension: str
    folder: Path

    @property
    def script(self) -> PanelScript:
        file, _, function = self.offer.target.partition(":")
        return PanelScript(self.offer.name, self.address(file.removeprefix("page/")), function)

    @property
    def styles(self) -> list[str]:
        return [self.address(file) for file in self.offer.styles]

    def address(self, file: str) -> str:
        """Return the name of a file of its folder among the page's files."""
        return f"{FOLDER}{self.extension}/{file}"


@dataclass(frozen=True)
class Document:
    """A document of the page that an extension offers.

    Attributes:
        folder: the folder `page` of the extension.
    """

    offer: PageDocument
    extension: str
    folder: Path

    @property
    def place(self) -> str:
        """Return its address."""
        return f"/{self.offer.name}{self.offer.path}"

    @property
    def file(self) -> str:
        """Return its name among the page's files."""
        return f"{FOLDER}{self.extension}/{self.offer.target.removeprefix('page/')}"


def places(document: str) -> list[str]:
    """Return the places that a document has for panels."""
    return _PLACE.findall(document)


def with_panels(document: str, panels: Sequence[Panel], address: str) -> str:
    """Return a document with the elements, stylesheets and scripts of its panels.

    Args:
        address: beginning of the addresses of stylesheets; scripts are joined ones.
    """
    shown = [one for one in panels if one.offer.place in places(document)]
    made = _PLACE.sub(
        lambda found: "".join(_element(one) for one in shown if one.offer.place == found[1]),
        _BUTTONS.sub(lambda found: "".join(_buttons(shown, found[1])), document),
    )
    links = [f'<link rel="stylesheet" href="{address}{f}">\n' for one in shown for f in one.styles]
    scripts = [
        f'<script type="module" src="{address}joined/{module}"></script>\n'
        for module in dict.fromkeys(one.script.module for one in shown)
    ]
    before, end, after = made.partition("</head>")
    return f"{before}{''.join((*links, *scripts))}{end}{after}"


def _element(panel: Panel) -> str:
    name, title = panel.offer.name, html.escape(panel.offer.title)
    own = f'data-panel="{name}" data-extension="{panel.extension}"'
    if panel.offer.place == "tabs":
        return (
            f'  <div class="tab" id="tab-{name}" role="tabpanel" aria-labelledby="open-{name}" '
            f'tabindex="0" {own} hidden></div>\n'
        )
    return f'<section id="{name}" aria-label="{title}" {own}></section>\n'


def _buttons(panels: Iterable[Panel], indent: str) -> Iterator[str]:
    """Yield the button of each tab, in order."""
    tabs = {name: (title, "") for name, title in TABS.items()}
    for offer in (one.offer for one in panels if one.offer.place == "tabs"):
        names = list(tabs)
        at = names.index(offer.after) + 1 if offer.after in tabs else len(names)
        names.insert(at, offer.name)
        tabs[offer.name] = offer.title, offer.icon
        tabs = {name: tabs[name] for name in names}
    for i, (name, (title, icon)) in enumerate(tabs.items()):
        selected = 'aria-selected="false" tabindex="-1"' if i else 'aria-selected="true"'
        drawn = f' data-icon="{html.escape(icon)}"' if icon else ""
        yield (
            f'{indent}<button role="tab" id="open-{name}" data-tab="{name}" '
            f'aria-controls="tab-{name}" {selected}{drawn}>'
            f"<span>{html.escape(title)}</span></button>\n"
        )
