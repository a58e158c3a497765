"""The declaration of the extension `checklist`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature, PagePanel

EXTENSION = Extension(
    name="checklist",
    summary="The checklist of the day on the Experiments tab, which begins anew each morning",
    protocol=1,
    offers=(
        PageFeature(name="checklist", target=".routes:FEATURE"),
        PagePanel(
            name="checklist",
            target="page/checklist.js:show",
            place="experiments",
            title="Checklist of the day",
            styles=("checklist.css",),
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "on the page of a simulated vehicle"),),
    docs="experiments.md",
)
