"""`quadlab user add|list|remove|role|password`: the accounts of a data folder.

A running page follows at once: a user who is removed, or gets another role or password, is signed
out.
"""

from __future__ import annotations

import contextlib
import getpass
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import tyro

from quadlab.data_folder import open_data_folder
from quadlab.option_types import Flag, Folder, optional
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from web.access.accounts import Account, Accounts

Action = Literal["add", "list", "remove", "role", "password"]
RoleName = Literal["viewer", "operator", "admin"]
_WITH_NAME = ("add", "remove", "role", "password")


@dataclass
class User:
    """Manage the accounts for the page: add, list, remove, role NAME ROLE, password."""

    action: Annotated[Action, tyro.conf.Positional]
    """what to do"""
    name: Annotated[str | None, tyro.conf.Positional, optional("NAME")] = None
    """name of the account; needed for all but list"""
    new_role: Annotated[RoleName | None, tyro.conf.Positional, optional("ROLE", "new-role")] = None
    """for role: the new role"""
    role: Annotated[RoleName | None, optional()] = None
    """for add: viewer watches, operator commands, admin also manages users (default: operator;
    the first account is an admin)"""
    password_stdin: Flag = False
    """read the password from standard input, one line"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        self._check_words()
        from web.access.accounts import check_name

        if self.name is not None:
            check_name(self.name)
        with self._accounts() as accounts:
            if self.action == "list":
                return _list(accounts.all())
            assert self.name is not None
            return self._change(accounts, self.name)

    def _change(self, accounts: Accounts, name: str) -> int:
        from web.access.roles import Role

        if self.action == "add":
            role = Role(self.role) if self.role else None
            accounts.check_new(name, role)  # before the password is typed
            made = accounts.add(name, role, self._ask(name))
            print(f"{name} may sign in as {made.role} now")
        elif self.action == "password":
            accounts.existing(name)
            accounts.set_password(name, self._ask(name))
            print(f"{name} has a new password and is signed out everywhere")
        elif self.action == "role":
            role = Role(self.new_role or self.role or "")
            accounts.set_role(name, role)
            print(f"{name} is {role} now, from the next sign-in on")
        else:
            accounts.remove(name)
            print(f"{name} is removed and signed out everywhere")
        return 0

    def _check_words(self) -> None:
        if self.action in _WITH_NAME and self.name is None:
            raise UsageError(f"user {self.action} needs a name: quadlab user {self.action} NAME")
        if self.action == "list" and self.name is not None:
            raise UsageError(f"user list takes no name, not {self.name!r:.60}")
        if self.action == "role":
            if (self.new_role is None) == (self.role is None):
                raise UsageError(
                    "user role needs one role: quadlab user role NAME "
                    + "|".join(get_args(RoleName))
                )
        elif self.new_role is not None:
            raise UsageError(
                f"user {self.action} takes no second word; give the role with --role"
                if self.action == "add"
                else f"user {self.action} takes no role, not {self.new_role!r}"
            )
        elif self.role is not None and self.action != "add":
            raise UsageError(f"user {self.action} takes no --role")

    @contextlib.contextmanager
    def _accounts(self) -> Iterator[Accounts]:
        from web.access.accounts import Accounts
        from web.access.database import AccessDatabase

        database = AccessDatabase(open_data_folder(self.data) / "web")
        try:
            yield Accounts(database)
        finally:
            database.close()

    def _ask(self, name: str) -> str:
        """Ask twice on a terminal, without echo; otherwise read one line of standard input."""
        from web.access.passwords import check_password

        if self.password_stdin or not sys.stdin.isatty():
            password = sys.stdin.readline().removesuffix("\n").removesuffix("\r")
            check_password(name, password)
            return password
        try:
            password = getpass.getpass(f"Password of {name}: ")
            check_password(name, password)
            again = getpass.getpass("The same again: ")
        except EOFError:
            raise UsageError("no password was typed; nothing was changed") from None
        if again != password:
            raise UsageError("the two passwords differ; nothing was changed")
        return password


def _list(accounts: list[Account]) -> int:
    if not accounts:
        print("no accounts yet; quadlab user add NAME makes one")
        return 0
    width = max(len(one.name) for one in accounts)
    for one in accounts:
        seen = "never signed in"
        if one.last_seen:
            seen = f"last seen {datetime.fromtimestamp(one.last_seen):%Y-%m-%d %H:%M}"
        print(f"{one.name:{width}}  {one.role:8}  {seen}")
    return 0
