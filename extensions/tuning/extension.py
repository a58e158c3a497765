"""The declaration of the extension `tuning`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature

EXTENSION = Extension(
    name="tuning",
    summary="Step tests of the position and yaw loops, and their gains",
    protocol=1,
    offers=(PageFeature(name="tuning", target=".routes:FEATURE"),),
    judged=(Judged(Evidence.SIMULATED, "step tests of the simulated vehicle"),),
    docs="tuning.md",
)
