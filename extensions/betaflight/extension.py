"""The declaration of the extension `betaflight`."""

from quadrotor.extension import Board, Evidence, Extension, Judged

EXTENSION = Extension(
    name="betaflight",
    summary="Boards with Betaflight, by MSP and CRSF",
    protocol=1,
    offers=(Board(name="betaflight", target=".board.board:KIND"),),
    judged=(
        Judged(Evidence.FIRMWARE, "Betaflight 4.6.0, its simulator target"),
        Judged(Evidence.PEER, "CRSF: the receiver code of Betaflight 4.6"),
    ),
    docs="boards/betaflight.md",
)
