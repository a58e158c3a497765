"""The declaration of the extension `laws`."""

from quadrotor.extension import (
    Command,
    Evidence,
    Extension,
    Group,
    Judged,
    Law,
    PageFeature,
    PagePanel,
)

EXTENSION = Extension(
    name="laws",
    summary="Control laws of the literature, to be flown and compared with the paper's",
    protocol=1,
    offers=(
        Law(
            name="pid_cascade",
            target=".pid_cascade:LAW",
            parameters=".parameters:PidCascadeParameters",
        ),
        Law(
            name="geometric_l1",
            target=".geometric_l1:LAW",
            parameters=".parameters:GeometricL1Parameters",
        ),
        Law(name="indi", target=".indi:LAW", parameters=".parameters:IndiParameters"),
        Law(
            name="flatness_indi",
            target=".flatness_indi:LAW",
            parameters=".parameters:FlatnessIndiParameters",
        ),
        Law(name="nmpc", target=".nmpc:LAW", parameters=".parameters:NmpcParameters"),
        PageFeature(name="arena", target=".arena.routes:FEATURE"),
        PagePanel(
            name="arena",
            target="page/arena.js:show",
            place="runs",
            title="Arena",
            styles=("arena.css",),
        ),
        Command(
            name="arena",
            target=".arena.command:Arena",
            group=Group.FLY,
            summary="Fly control laws on courses under disturbances in compiled code, and print "
            "tables of their errors.",
            examples={
                "quadlab arena": "compare all laws on 12 seeds",
                'quadlab arena --laws "geometric indi"': "compare two",
            },
        ),
    ),
    judged=(Judged(Evidence.SIMULATED, "flights of the vehicle's own code"),),
    docs="how_to/arena.md",
)
