"""The declaration of the extension `formations`."""

from quadrotor.extension import Evidence, Experiment, Extension, Judged

EXTENSION = Extension(
    name="formations",
    summary="Several vehicles that see each other by bearings, and fly as a formation",
    protocol=1,
    offers=(
        Experiment(name="formation", target=".experiment:FormationExperiment"),
        Experiment(name="look_around", target=".look_around:LookAroundExperiment"),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights of five whole vehicles in one simulated time"),),
    docs="how_to/formations.md",
)
