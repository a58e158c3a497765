"""The requester: the session the gate put next to each request, and what its role allows."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, HTTPException, Request

from web.access.roles import Role, Session


def session_of(request: Request) -> Session:
    """Put there by `web.access.gate.Gate`, without which no request comes this far."""
    session: Session = request.scope["session"]
    return session


Asker = Annotated[Session, Depends(session_of)]


def operator_of(session: Asker) -> Session:
    """Return the session; answers 403 to a viewer."""
    if not session.role.may(Role.OPERATOR):
        raise HTTPException(
            403, f"{session.label} may watch but not command; ask an operator for an invitation"
        )
    return session


Operator = Annotated[Session, Depends(operator_of)]


def admin_of(session: Asker) -> Session:
    """Return the session; answers 403 to all but admins."""
    if not session.role.may(Role.ADMIN):
        raise HTTPException(403, f"{session.label} is no admin; users are managed by admins")
    return session


Admin = Annotated[Session, Depends(admin_of)]
