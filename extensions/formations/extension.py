"""The declaration of the extension `formations`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Experiment,
    Extension,
    Group,
    Judged,
    PageFeature,
    PagePanel,
)

EXTENSION = Extension(
    name="formations",
    summary="Several vehicles that see each other by bearings, and fly as a formation",
    protocol=1,
    offers=(
        Experiment(name="formation", target=".experiment:FormationExperiment"),
        Experiment(name="look_around", target=".look_around:LookAroundExperiment"),
        PageFeature(name="formation", target=".live.routes:FEATURE"),
        PagePanel(
            name="formation",
            target="page/formation.js:show",
            place="fleet",
            title="Formation",
            styles=("formation.css",),
        ),
        Command(
            name="formations",
            target=".dataset:Dataset",
            group=Group.FLY,
            summary="Fly a formation several times, and write truth, bearings and covariances as "
            "MCAP and Parquet.",
            examples={"quadlab formations OUT": "make a dataset of ten flights"},
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights of five whole vehicles in one simulated time"),),
    docs="how_to/formations.md",
)
