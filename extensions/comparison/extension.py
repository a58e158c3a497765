"""The declaration of the extension `comparison`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature, PagePanel, StationPart

EXTENSION = Extension(
    name="comparison",
    summary="Estimators run at the station in flight, compared with the truth on the Beacons tab",
    protocol=1,
    offers=(
        StationPart(
            name="comparison", target=".feed:make", parameters=".parameters:ComparisonParameters"
        ),
        PageFeature(name="comparison", target=".routes:FEATURE"),
        PagePanel(
            name="comparison",
            target="page/comparison.js:show",
            place="beacons",
            title="Estimators compared",
            styles=("comparison.css",),
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights on bearings of the simulated vehicle"),),
    docs="beacons.md",
)
