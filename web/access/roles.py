"""Roles, and the session of a signed-in browser."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Role(StrEnum):
    """Role of a person; each role may do all that the roles above it may."""

    VIEWER = "viewer"  # watch
    OPERATOR = "operator"  # command
    ADMIN = "admin"  # also: users, invitations of operators, ending sessions

    def may(self, least: Role) -> bool:
        """Return whether this role is `least` or more. (`<` would compare the words.)"""
        return _RANK[self] >= _RANK[least]


_RANK = {role: rank for rank, role in enumerate(Role)}


@dataclass(frozen=True, slots=True)
class Session:
    """Session of a signed-in browser.

    `label` is the requester of its commands: an account's name, or `operator 1` for a browser that
    signed in by a link (names of accounts have no spaces).
    """

    label: str
    role: Role
    id: str = ""
    generation: int = 0  # of the account at sign-in; 0 without one
    issued: int = 0  # s, epoch

    @property
    def has_account(self) -> bool:
        return self.generation > 0
