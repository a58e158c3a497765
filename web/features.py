"""The features of the page: each adds its routes to every vehicle and has its own services.

A vehicle's context offers what features share, and knows none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from quadrotor.errors import UsageError
from quadrotor.extension import PageFeature, PagePanel
from quadrotor.extensions import registry
from web.beacons.routes import add_beacons
from web.beacons.survey import SurveyRun, add_survey
from web.experiments.calibrations import add_calibration
from web.experiments.experiments import add_experiments
from web.experiments.reports import add_reports
from web.feature import Feature
from web.panels import TAKEN, Panel
from web.replay.routes import add_replay
from web.replay.store import ReplayStore
from web.runs.report_making import ReportMaking
from web.runs.routes import add_runs


def built_in(survey: SurveyRun | None) -> tuple[Feature, ...]:
    """Return the features of every page; `survey` is None where no survey can be made."""
    reports, replays = ReportMaking(), ReplayStore()
    return (
        Feature(add_runs),
        Feature(lambda app, context: add_replay(app, context.catalogue, replays)),
        Feature(add_experiments),
        Feature(add_calibration),
        Feature(partial(add_reports, reports=reports), reports.stop),
        Feature(add_beacons),
        Feature(partial(add_survey, run=survey)),
    )


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
        spec = find_spec(offered.package)
        assert offered.extension is not None
        assert spec is not None
        assert spec.origin is not None
        yield Panel(offered.offer, offered.extension.name, Path(spec.origin).parent / "page")
