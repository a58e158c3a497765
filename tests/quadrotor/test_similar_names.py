"""The question that follows a mistyped name."""

from __future__ import annotations

from quadrotor.similar_names import did_you_mean

BOARDS = ["mikrokopter", "betaflight", "crazyflie"]


def test_similar_names_are_asked_about_and_others_are_not() -> None:
    assert did_you_mean("mikrokoper", BOARDS) == "did you mean mikrokopter?"
    assert did_you_mean("px4", BOARDS, before="; ", after=" ") == ""
    assert did_you_mean("kp_x", ["kp_xy", "kp_z"], before="; ") == "; did you mean kp_xy or kp_z?"
    assert did_you_mean("kp_x", ["kp_xy", "kd"], after=" ") == "did you mean kp_xy? "
