"""The declaration of the extension `link_test`."""

from quadrotor.extension import Command, Evidence, Extension, Judged

EXTENSION = Extension(
    name="link_test",
    summary="The quality of a link to a vehicle, measured and judged",
    protocol=1,
    offers=(
        Command(
            name="link test",
            target=".command:Test",
            summary="Connect to a vehicle, measure the link for some seconds, and judge it.",
            examples={"quadlab link test quad1": "measure latency, loss and throughput"},
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "links of its tests, which lose and delay packets"),),
    docs="link.md",
)
