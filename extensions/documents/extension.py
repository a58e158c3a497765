"""The declaration of the extension `documents`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature, PagePanel

EXTENSION = Extension(
    name="documents",
    summary="The documents on the page itself, without a network, and a search of all it knows",
    protocol=1,
    offers=(
        PageFeature(name="documents", target=".routes:FEATURE"),
        PagePanel(
            name="documents",
            target="page/search.js:show",
            place="corner",
            title="Search",
            styles=("search.css",),
        ),
        PagePanel(
            name="find",
            target="page/elsewhere.js:show",
            place="head",
            title="Search",
            styles=("search.css",),
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "in Chromium, on the simulated vehicle"),),
    docs="page/search.md",
)
