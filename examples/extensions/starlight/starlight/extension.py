"""The declaration: what the extension adds, by name; nothing else of it is imported until then."""

from quadrotor.extension import Evidence, Extension, Judged, PageFeature, PagePanel, TrackingSystem

EXTENSION = Extension(
    name="starlight",
    summary="The tracking system starlight, which sends a line of JSON for each frame over TCP",
    protocol=1,
    offers=(
        TrackingSystem(name="starlight", target=".tracker:SYSTEM", port=7801),
        PageFeature(name="starlight", target=".routes:FEATURE"),
        PagePanel(
            name="starlight",
            target="page/starlight.js:show",
            place="tabs",
            title="Starlight",
            styles=("starlight.css",),
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "a server in its own test"),),
)
