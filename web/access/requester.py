"""Requester of a request: the session that the gate has stored, and what its role allows."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, HTTPException, Request

from web.access.roles import Role, Session


def session_of(request: Request) -> Session:
    """Return the session stored by `web.access.gate.Gate`, which passes no request without one."""
    session: Session = request.scope["session"]
    return session


Asker = Annotated[Session, Depends(session_of)]


def operator_of(session: Asker) -> Session:
    """Return the session, or answer 403 to a viewer."""
    if not session.role.may(Role.OPERATOR):
        raise HTTPException(
            403, f"{session.label} may watch but not command; ask an operator for an invitation"
        )
    return session


Operator = Annotated[Session, Depends(operator_of)]


def admin_of(session: Asker) -> Session:
    """Return the session, or answer 403 to anyone but an admin."""
    if not session.role.may(Role.ADMIN):
        raise HTTPException(403, f"{session.label} is not an admin; only admins manage users")
    return session


Admin = Annotated[Session, Depends(admin_of)]
