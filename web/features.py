"""The features of the page: each adds its routes to every vehicle and has its own services.

A vehicle's context offers what features share, and knows none of them. Those of the page itself are
offered and loaded as those of extensions are.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from quadrotor.errors import UsageError
from quadrotor.extension import PageDocument, PageFeature, PagePanel
from quadrotor.extensions import Offered, registry
from web.feature import Feature
from web.panels import TAKEN, Document, Panel

BUILT_IN = (
    PageFeature(name="runs", target=".runs.routes:new_feature"),
    PageFeature(name="experiments", target=".experiments.experiments:new_feature"),
    PageFeature(name="calibrations", target=".experiments.calibrations:new_feature"),
    PageFeature(name="reports", target=".experiments.reports:new_feature"),
    PageFeature(name="beacons", target=".beacons.routes:new_feature"),
    PageFeature(name="survey", target=".beacons.survey:new_feature"),
)
"""The features of every page. Each target makes one, and its services, for one web process."""


def built_in() -> tuple[Feature, ...]:
    """Return new features of every page, one of each."""
    return tuple(Offered(one, __package__).load()() for one in BUILT_IN)


def of_extensions(say: Callable[[str, str], None]) -> Iterator[Feature]:
    """Yield the features that extensions offer; `say` is told of those that cannot be loaded."""
    for name, offered in registry().offers(PageFeature).items():
        try:
            feature: Feature = offered.load()
        except UsageError as error:
            say("error", str(error))
        else:
            yield replace(feature, name=name)


def panels_of_extensions() -> Iterator[Panel]:
    """Yield the panels that extensions offer; their files may be missing."""
    for offered in registry().offers(PagePanel, TAKEN).values():
        yield Panel(offered.offer, *_page_of(offered))


def documents_of_extensions(taken: Collection[str] = ()) -> Iterator[Document]:
    """Yield the documents that extensions offer, but those with a name of the page's own."""
    for offered in registry().offers(PageDocument, taken).values():
        yield Document(offered.offer, *_page_of(offered))


def _page_of(offered: Offered[PagePanel] | Offered[PageDocument]) -> tuple[str, Path]:
    """Return the name of an extension, and its folder `page`."""
    spec = find_spec(offered.package)
    assert offered.extension is not None
    assert spec is not None
    assert spec.origin is not None
    return offered.extension.name, Path(spec.origin).parent / "page"
