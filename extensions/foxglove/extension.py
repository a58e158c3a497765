"""The declaration of the extension `foxglove`."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature

EXTENSION = Extension(
    name="foxglove",
    summary="Foxglove, Lichtblick and other programs that show a flight live",
    protocol=1,
    offers=(PageFeature(name="foxglove", target=".routes:FEATURE"),),
    judged=(Judged(Evidence.PEER, "Foxglove's client @foxglove/ws-protocol and its Studio 1.48"),),
    docs="extending/foxglove.md",
)
