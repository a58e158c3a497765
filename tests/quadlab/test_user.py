"""`quadlab user` as a newcomer uses it, and with wrong words: one line, status 2 or 1."""

from __future__ import annotations

import io
import os
import pty
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from quadlab.__main__ import main
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.passwords import Passwords

WORDS = "correct horse battery"


@pytest.fixture(autouse=True)
def cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Passwords.__init__
    monkeypatch.setattr(Passwords, "__init__", lambda self: plain(self, 1, 8))


@pytest.fixture
def user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Any:
    def run(*words: str, typed: str = "") -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
        status = main(["user", *words, "--data", str(tmp_path)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def accounts(data: Path) -> Accounts:
    return Accounts(AccessDatabase(data / "web"))


def test_a_newcomers_first_account(user: Any, tmp_path: Path) -> None:
    assert user("list") == (0, "no accounts yet; quadlab user add NAME makes one\n", "")
    status, out, err = user("add", "anna", typed=WORDS + "\n")
    assert (status, err) == (0, "")
    assert out == "anna may sign in as admin now\n"
    assert accounts(tmp_path).verify("anna", WORDS) is not None
    assert user("add", "bob", "--password-stdin", typed=WORDS + "\r\n")[0] == 0
    assert user("add", "vera", "--role", "viewer", typed=WORDS)[0] == 0
    status, out, _ = user("list")
    assert [line.split()[:2] for line in out.splitlines()] == [
        ["anna", "admin"],
        ["bob", "operator"],
        ["vera", "viewer"],
    ]
    assert "never signed in" in out
    assert accounts(tmp_path).verify("bob", WORDS) is not None, "the line's end is no part of it"


def test_role_password_and_removal(user: Any, tmp_path: Path) -> None:
    for name in ("anna", "bob"):
        user("add", name, typed=WORDS)
    assert user("role", "bob", "viewer")[1] == "bob is viewer now, from the next sign-in on\n"
    assert user("role", "bob", "--role", "admin")[0] == 0
    assert user("password", "bob", typed="another staple here")[0] == 0
    assert accounts(tmp_path).verify("bob", WORDS) is None
    assert accounts(tmp_path).verify("bob", "another staple here") is not None
    assert user("remove", "bob") == (0, "bob is removed and signed out everywhere\n", "")
    assert [one.name for one in accounts(tmp_path).all()] == ["anna"]


@pytest.mark.parametrize(
    ("words", "typed", "status", "said"),
    [
        ([], "", 2, "add"),
        (["ad", "bob"], "", 2, "add"),
        (["add"], "", 2, "quadlab user add NAME"),
        (["add", "Bob"], WORDS, 2, "is not a valid user name"),
        (["add", "bob", "--role", "boss"], WORDS, 2, "operator"),
        (["add", "bob", "viewer"], WORDS, 2, "give the role with --role"),
        (["add", "bob"], "short", 1, "it has 5, at least 10 characters are needed"),
        (["add", "bob"], "", 1, "it is empty"),
        (["add", "anna"], WORDS, 1, "has an account already"),
        (["list", "anna"], "", 2, "takes no name"),
        (["remove", "nobody"], "", 1, "no user 'nobody'; there are anna, vera"),
        (["remove", "anna"], "", 1, "last admin"),
        (["remove", "anna", "--role", "viewer"], "", 2, "takes no --role"),
        (["role", "anna"], "", 2, "viewer|operator|admin"),
        (["role", "anna", "operator"], "", 1, "last admin"),
        (["role", "nobody", "operator"], "", 1, "no user 'nobody'"),
        (["password", "nobody"], WORDS, 1, "no user 'nobody'"),
        (["password", "anna"], "anna", 1, "at least 10"),
    ],
)
def test_what_is_wrong_is_one_line_and_changes_nothing(
    user: Any, tmp_path: Path, words: list[str], typed: str, status: int, said: str
) -> None:
    user("add", "anna", typed=WORDS)
    user("add", "vera", "--role", "viewer", typed=WORDS)
    before = accounts(tmp_path).all()
    answered, out, err = user(*words, typed=typed)
    assert (answered, out) == (status, "")
    assert err.startswith("quadlab: ")
    assert err.count("\n") == 1
    assert said in err
    assert accounts(tmp_path).all() == before


def test_on_a_terminal_it_is_asked_twice_without_echo(tmp_path: Path) -> None:
    def typed(*answers: str) -> tuple[int, str]:
        child, terminal = pty.fork()
        if child == 0:  # pragma: no cover
            words = ["-m", "quadlab", "user", "add", "anna", "--data", str(tmp_path)]
            os.execv(sys.executable, [sys.executable, *words])
        shown = ""
        for prompt, answer in zip(("Password of anna: ", "The same again: "), answers, strict=True):
            while prompt not in shown:
                shown += os.read(terminal, 1024).decode()
            os.write(terminal, answer.encode() + b"\n")
        try:
            while more := os.read(terminal, 1024):
                shown += more.decode()
        except OSError:  # on Linux, the other end has closed
            pass
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), shown

    status, shown = typed(WORDS, "another staple here")
    assert status == 2
    assert "the two passwords differ" in shown
    assert accounts(tmp_path).count() == 0
    status, shown = typed(WORDS, WORDS)
    assert status == 0
    assert "may sign in as admin" in shown
    assert WORDS not in shown


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--host", "0.0.0.0"], "needs TLS (add --tls) and at least one account"),
        (["--host", "0.0.0.0", "--tls"], "needs at least one account (quadlab user add NAME)"),
        (["--host", "nowhere.invalid", "--tls"], "is not known"),
        (["--tls-key", "x.key"], "go together"),
        (["--tls-certificate", "x.pem", "--tls-key", "x.key"], "x.pem cannot be read"),
    ],
)
@pytest.mark.parametrize("command", ["web", "up"])
def test_a_page_for_others_needs_tls_and_an_account(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str, words: list[str], said: str
) -> None:
    more = ["--port", "18158", "--data", str(tmp_path)]
    if command == "up":
        more += ["--link-port", "18159", "--no-browser"]
    assert main([command, *words, *more]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "web").exists()


def test_the_password_is_no_word_of_the_command_line() -> None:
    """Every user of the computer can read a command line."""
    ran = subprocess.run(
        [sys.executable, "-m", "quadlab", "user", "add", "anna", "--password", WORDS],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1
