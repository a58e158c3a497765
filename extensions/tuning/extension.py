"""The declaration of the extension `tuning`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature, PagePanel

EXTENSION = Extension(
    name="tuning",
    summary="Step tests of the position and yaw loops, and their gains",
    protocol=1,
    offers=(
        PageFeature(name="tuning", target=".routes:FEATURE"),
        PagePanel(
            name="tune",
            target="page/tune.js:show",
            place="tabs",
            title="Tune",
            styles=("tune.css",),
            icon="M2.5 16H6c1.5-16 3-13 4-9s2 2.5 3 1 1.5-.5 4.5-.5",
            after="gains",
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "step tests of the simulated vehicle"),),
    docs="tuning.md",
)
