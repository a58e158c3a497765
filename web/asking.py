"""Who asks: the session the gate put beside each request."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, HTTPException, Request

from web.door import Role, Session


def session_of(request: Request) -> Session:
    """Put there by `web.gate.Gate`, without which no request comes this far."""
    session: Session = request.scope["session"]
    return session


Asker = Annotated[Session, Depends(session_of)]


def operator_of(session: Asker) -> Session:
    """Answers 403 to a viewer."""
    if session.role is not Role.OPERATOR:
        raise HTTPException(
            403, f"{session.label} may watch but not command; ask an operator for an invitation"
        )
    return session


Operator = Annotated[Session, Depends(operator_of)]
