"""The declaration of the extension `batches`."""

from quadrotor.extension import Evidence, Extension, Function, Judged

EXTENSION = Extension(
    name="batches",
    summary="Many flights of the 8 at once, in compiled code",
    protocol=1,
    offers=(
        Function(name="batch", target=".batch:fly_batch"),
        Function(name="Scenario", target=".batch:Scenario"),
    ),
    judged=(
        Judged(Evidence.PEER, "the same loop in C++ (benchmarks/peers/cpp_twin.py)"),
        Judged(Evidence.SIMULATED, "flights of the vehicle's own code"),
    ),
    docs="extending/notebooks.md",
)
