"""The rights of a station at a vehicle, by the common name of its certificate.

A pilot may do everything. An observer receives telemetry and status and may use the services that
change nothing; it cannot send poses, sticks, heartbeats, commands or parameter values. Zenoh
enforces this on board and denies without an answer, so a vehicle serves `whoami` to all, and
`pilot/whoami` to those whose commands it accepts.
"""

from __future__ import annotations

from typing import Literal

from vehicle_link.topics.table import TOPICS

Access = Literal["pilot", "observer"]
COMMON_NAMES: dict[Access, str] = {"pilot": "quadlab station", "observer": "quadlab observer"}

WHOAMI = "whoami"
PILOT_WHOAMI = "pilot/whoami"
LANE, PILOT_LANE = "lane", "pilot/lane"
"""Services that give a station the keys of the lane; the first one is for receiving only."""

READ_ONLY_SERVICES = (
    WHOAMI,
    LANE,
    "time_sync",
    "checks",
    "onboard_log",
    "onboard_files",
    "onboard_part",
    "vehicle/get_parameters",
    "vehicle/get_parameter_types",
    "vehicle/list_parameters",
    "vehicle/describe_parameters",
)
"""Services that change nothing."""

_TOKENS = "@ros2_lv/**"  # "**" does not match names with a leading @
_DOWN = ("put", "delete", "reply", "declare_queryable", "liveliness_token")
_UP = ("declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query")


def access_control() -> dict[str, object]:
    """Return the vehicle's access control for Zenoh; other certificates have no rights."""
    topics = [row.name for row in TOPICS.values() if row.sender == "vehicle"]
    open_to_all = [*(f"*/*/{name}/**" for name in (*topics, *READ_ONLY_SERVICES)), _TOKENS]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            _rule("everything", (*_DOWN, *_UP), ("ingress", "egress"), ["**", _TOKENS]),
            _rule("told", _DOWN, ("egress",), open_to_all),
            _rule("asked", _UP, ("ingress",), open_to_all),
        ],
        "subjects": [
            {"id": access, "cert_common_names": [name]} for access, name in COMMON_NAMES.items()
        ],
        "policies": [
            {"rules": ["everything"], "subjects": ["pilot"]},
            {"rules": ["told", "asked"], "subjects": ["observer"]},
        ],
    }


def _rule(
    name: str, messages: tuple[str, ...], flows: tuple[str, ...], keys: list[str]
) -> dict[str, object]:
    return {
        "id": name,
        "permission": "allow",
        "messages": list(messages),
        "flows": list(flows),
        "key_exprs": keys,
    }
