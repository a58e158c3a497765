"""The declaration of the extension `crazyflie`."""

from quadrotor.extension import Board, Command, Evidence, Extension, Group, Judged, Link

EXTENSION = Extension(
    name="crazyflie",
    summary="Crazyflies, by CRTP over a Crazyradio or UDP",
    protocol=1,
    offers=(
        Board(name="crazyflie", target=".board.kind:KIND"),
        Link(name="udp", target=".crtp.links:open_udp", example="udp://127.0.0.1:19850"),
        Link(name="radio", target=".crtp.radio:open_radio", example="radio://0/80/2M/E7E7E7E7E7"),
        Command(
            name="crazyradio",
            group=Group.PROCESS,
            summary="Serve each Crazyflie on one Crazyradio by UDP to a `quadlab vehicle` of its "
            "own, and land it when that falls silent in flight.",
            target=".crazyradio:Crazyradio",
            examples={
                "quadlab crazyradio radio://0/80/2M/E7E7E7E701=19850 "
                "radio://0/80/2M/E7E7E7E702=19851": "share one radio between two Crazyflies"
            },
        ),
    ),
    judged=(Judged(Evidence.PEER, "cflib 0.1.34, Bitcraze's client, on the simulated one"),),
    libraries={"usb": "`pip install 'quadlab[crazyflie]'`"},
    docs="boards/crazyflie.md",
)
