"""The declaration of the extension `explanation`."""

from quadrotor.extension import Evidence, Explanation, Extension, Function, Judged

EXTENSION = Extension(
    name="explanation",
    summary="Explanation of a flight: what happened and why, causes with their figures first",
    protocol=1,
    offers=(
        Explanation(name="flight", target=".explain:explain"),
        Function(name="levels", target=".levels:levels"),
    ),
    judged=(
        Judged(
            Evidence.SIMULATED,
            "flights with each fault of the library and without, on seeds that were not used to "
            "choose limits (python -m benchmarks diagnosis)",
        ),
    ),
    docs="reports.md",
)
