"""The declaration of the extension `reports`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Extension,
    Function,
    Judged,
    PageFeature,
    ReportWriter,
)

EXTENSION = Extension(
    name="reports",
    summary="Reports of runs with figures, metrics and parameters, as a page and a PDF",
    protocol=1,
    offers=(
        ReportWriter(name="report", target=".report:write_report"),
        Function(name="report_page", target=".html:render"),
        PageFeature(name="figure", target=".routes:FEATURE"),
        Command(
            name="log report",
            target=".command:Report",
            summary="Write figures, metrics, parameters and calibrations of a log as a page and a "
            "PDF.",
            examples={"quadlab log report LOG": "make a report of a recorded flight"},
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "runs of each experiment"),),
    docs="reports.md",
)
