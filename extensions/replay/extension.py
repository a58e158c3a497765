"""The declaration of the extension `replay`."""

from quadrotor.extension import Evidence, Extension, Judged, PageDocument, PageExporter, PageFeature

EXTENSION = Extension(
    name="replay",
    summary="Recorded flights on the page: replayed in 3D and charts, and compared with each other",
    protocol=1,
    offers=(
        PageFeature(name="replay", target=".routes:FEATURE"),
        PageDocument(name="replay", target="page/replay/replay.html", path="/{run_id}"),
        PageDocument(name="compare", target="page/compare/compare.html"),
        PageExporter(name="page", target=".exported_page:export_page"),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights of the simulated vehicle, against their logs"),),
    docs="page/replay_page.md",
)
