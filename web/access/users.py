"""Sign-out, and the management of users by an admin: /api/session/… and /api/users."""

from __future__ import annotations

import asyncio
from dataclasses import asdict

from fastapi import FastAPI, HTTPException, Request
from fastapi.responses import JSONResponse, Response
from pydantic import Field

from quadrotor.errors import RefusedError
from quadrotor.json_object import JsonObject
from web.access.people import People
from web.access.requester import Admin, Asker
from web.access.roles import Role
from web.access.sessions import Seen
from web.access.sign_in import Refusal, address_of
from web.body import Body


class SignOutBody(Body):
    everywhere: bool = Field(False, description="all browsers of this account")


class PasswordBody(Body):
    password: str = Field(max_length=1000)


class OwnPasswordBody(PasswordBody):
    current: str = Field(max_length=1000)


class RoleBody(Body):
    role: Role


class UserBody(PasswordBody):
    name: str = Field(max_length=64)
    role: Role | None = Field(None, description="operator by default; the first one is an admin")


def add_users(app: FastAPI, people: People) -> None:
    _add_session(app, people)
    _add_management(app, people)


def _add_session(app: FastAPI, people: People) -> None:
    @app.post("/api/session/sign_out")
    async def sign_out(session: Asker, body: SignOutBody | None = None) -> JSONResponse:
        """End this session, or with `everywhere` all of the account, and close their websockets."""
        if body is not None and body.everywhere and session.has_account:
            await asyncio.to_thread(people.accounts.end_sessions, session.label)
            people.sign_in.report("info", f"{session.label} signed out everywhere")
        else:
            await asyncio.to_thread(people.sessions.end, session)
            people.sign_in.report("info", f"{session.label} signed out")
        people.sockets.check()
        answer = JSONResponse({"signed_out": True})
        people.cookie.clear(answer)
        return answer

    @app.put("/api/session/password")
    async def change_own(body: OwnPasswordBody, session: Asker, request: Request) -> Response:
        """Set a new password for your own account; its other browsers are signed out."""
        if not session.has_account:
            raise RefusedError(f"{session.label} signed in by a link and has no password")
        account = await people.sign_in.verify(session.label, body.current, address_of(request))
        if isinstance(account, Refusal):
            status = 403 if account.status == 401 else account.status
            wait = {"Retry-After": str(account.wait)} if account.wait else None
            line = "the current password is wrong" if status == 403 else account.line
            raise HTTPException(status, line, wait)
        changed = await people.hashing.run(
            people.accounts.set_password, session.label, body.password
        )
        again = await people.sign_in.open(changed)
        people.sign_in.report("info", f"{session.label} has a new password")
        people.sockets.check()
        return people.signed_in(JSONResponse({"changed": True}), again)


def _add_management(app: FastAPI, people: People) -> None:
    accounts, report = people.accounts, people.sign_in.report

    @app.get("/api/users")
    async def users(_: Admin) -> list[JsonObject]:
        """Return the accounts and the people signed in by a link.

        `last_seen` is in s, epoch; 0 = never.
        """
        return await asyncio.to_thread(_everyone, people)

    @app.post("/api/users", status_code=201)
    async def add(body: UserBody, session: Admin) -> dict[str, str]:
        made = await people.hashing.run(accounts.add, body.name, body.role, body.password)
        report("info", f"{session.label} added {made.name} as {made.role}")
        return {"name": made.name, "role": made.role.value}

    @app.delete("/api/users/{name}")
    async def remove(name: str, session: Admin) -> dict[str, str]:
        await asyncio.to_thread(accounts.remove, name)
        people.sockets.check()
        report("info", f"{session.label} removed {name}")
        return {"removed": name}

    @app.put("/api/users/{name}/role")
    async def set_role(name: str, body: RoleBody, session: Admin) -> dict[str, str]:
        """Set the role of a user, who is signed out everywhere."""
        await asyncio.to_thread(accounts.set_role, name, body.role)
        people.sockets.check()
        report("info", f"{session.label} made {name} {body.role}")
        return {"name": name, "role": body.role.value}

    @app.put("/api/users/{name}/password")
    async def set_password(name: str, body: PasswordBody, session: Admin) -> dict[str, str]:
        """Set the password of a user, who is signed out everywhere."""
        await people.hashing.run(accounts.set_password, name, body.password)
        people.sockets.check()
        report("info", f"{session.label} gave {name} a new password")
        return {"name": name}

    @app.post("/api/users/{name}/end_sessions")
    async def end_sessions(name: str, session: Admin) -> dict[str, str]:
        """Sign an account out everywhere, or end the sessions of a link such as `operator 1`."""
        if " " in name:
            await asyncio.to_thread(people.sessions.end_guests, name)
        else:
            await asyncio.to_thread(accounts.end_sessions, name)
        people.sockets.check()
        report("info", f"{session.label} ended the sessions of {name}")
        return {"ended": name}


def _everyone(people: People) -> list[JsonObject]:
    online = people.sessions.people()
    sessions = {one.label: one.sessions for one in online if one.has_account}
    known = [
        Seen(one.name, one.role, True, sessions.get(one.name, 0), one.last_seen)
        for one in people.accounts.all()
    ]
    return [shown(one) for one in (*known, *(one for one in online if not one.has_account))]


def shown(one: Seen) -> JsonObject:
    """Return a person as JSON for the page; `last_seen` is in s, epoch."""
    fields = asdict(one)
    return {"name": fields.pop("label"), "account": fields.pop("has_account"), **fields}
