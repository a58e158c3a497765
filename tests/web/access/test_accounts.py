"""Accounts: names, passwords, the last admin, and sessions that end when an account changes."""

from __future__ import annotations

import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from quadrotor.errors import RefusedError, StorageError, UsageError
from tests.support.clock import Clock
from web.access.accounts import Accounts
from web.access.database import NAME, AccessDatabase, count_accounts
from web.access.passwords import LONGEST, SHORTEST, Passwords, check_password
from web.access.roles import Role
from web.access.sessions import PER_LABEL, SESSION_AGE, Sessions

WORDS = "correct horse battery"
OTHER = "another staple here"


@pytest.fixture
def clock() -> Clock:
    return Clock(1_800_000_000.0)


@pytest.fixture
def database(tmp_path: Path) -> Iterator[AccessDatabase]:
    opened = AccessDatabase(tmp_path)
    yield opened
    opened.close()


@pytest.fixture
def accounts(database: AccessDatabase, clock: Clock) -> Accounts:
    made = Accounts(database, Passwords(1, 8), clock)
    made.add("anna", Role.ADMIN, WORDS)
    return made


@pytest.fixture
def sessions(database: AccessDatabase, clock: Clock) -> Sessions:
    return Sessions(database, clock)


def test_roles_are_ordered_and_each_may_what_those_before_may() -> None:
    ranked = [Role.VIEWER, Role.OPERATOR, Role.ADMIN]
    for have, role in enumerate(ranked):
        assert [role.may(least) for least in ranked] == [need <= have for need in range(3)]


def test_a_password_verifies_and_another_does_not(accounts: Accounts) -> None:
    account = accounts.verify("anna", WORDS)
    assert account is not None
    assert (account.name, account.role) == ("anna", Role.ADMIN)
    for wrong in ("", WORDS + " ", WORDS.upper(), OTHER, "x" * 100_000):
        assert accounts.verify("anna", wrong) is None


@pytest.mark.parametrize("name", ["bob", "", "Anna", "anna' or 1=1 --", "a" * 5000, "ännä", "\0"])
def test_an_unknown_name_is_nobody(accounts: Accounts, name: str) -> None:
    assert accounts.verify(name, WORDS) is None


def test_an_unknown_name_costs_the_same_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The work is counted, not timed: the hash compared against has the costs of a real one."""
    import argon2

    compared: list[argon2.Parameters] = []
    plain = argon2.PasswordHasher.verify

    def verify(self: argon2.PasswordHasher, encoded: str, password: str) -> bool:
        compared.append(argon2.extract_parameters(encoded))
        return plain(self, encoded, password)

    monkeypatch.setattr(argon2.PasswordHasher, "verify", verify)
    passwords = Passwords(2, 16)
    assert passwords.matches(passwords.hash(WORDS), WORDS)
    assert not passwords.matches(None, WORDS)
    assert compared[0] == compared[1]
    assert compared[0].type is argon2.Type.ID


def test_hashes_are_salted_and_made_with_the_costs_we_state() -> None:
    import argon2

    passwords = Passwords()
    first, second = passwords.hash(WORDS), passwords.hash(WORDS)
    assert first != second
    costs = argon2.extract_parameters(first)
    assert (costs.time_cost, costs.memory_cost, costs.parallelism) == (3, 65536, 1)
    assert WORDS not in first


def test_a_damaged_hash_matches_nothing() -> None:
    for encoded in ("", "x", "$argon2id$v=19$m=8,t=1,p=1$AAAA"):
        assert not Passwords(1, 8).matches(encoded, WORDS)


def test_one_password_typed_in_two_unicode_forms_is_one() -> None:
    passwords = Passwords(1, 8)
    assert passwords.matches(passwords.hash("schlüssel-bund"), "schlu\u0308ssel-bund")


def test_a_hash_of_other_costs_is_made_anew_at_the_next_sign_in(
    database: AccessDatabase, accounts: Accounts, sessions: Sessions
) -> None:
    before = accounts.verify("anna", WORDS)
    assert before is not None
    session = sessions.open("anna", before.role, before.generation)
    dearer = Passwords(2, 16)
    again = Accounts(database, dearer).verify("anna", WORDS)
    assert again is not None
    assert again.generation == before.generation
    encoded = _hash_of(database, "anna")
    assert not dearer.is_outdated(encoded)
    assert dearer.matches(encoded, WORDS)
    assert sessions.is_open(session), "the same password: nobody is signed out"


@pytest.mark.parametrize(
    ("password", "said"),
    [
        ("", "it is empty"),
        ("x" * (SHORTEST - 1), f"it has {SHORTEST - 1}, at least {SHORTEST}"),
        ("x" * (LONGEST + 1), f"allowed are {LONGEST}"),
        ("x" * SHORTEST, "too easy to guess"),
        ("Annaannaanna", "too easy to guess"),
    ],
)
def test_a_weak_password_is_refused_with_the_reason(password: str, said: str) -> None:
    with pytest.raises(RefusedError, match=said) as caught:
        check_password("annaannaanna", password)
    assert "\n" not in str(caught.value)
    check_password("anna", "0123456789")


@pytest.mark.parametrize("name", ["", "Anna", "1a", "a b", "a" * 33, "ä", "a/b", "a\n", "-a"])
def test_what_is_no_name_is_refused(accounts: Accounts, name: str) -> None:
    with pytest.raises(UsageError, match="is not a valid user name"):
        accounts.add(name, None, WORDS)


def test_names_of_all_allowed_letters_are_taken(accounts: Accounts) -> None:
    for name in ("b", "a_b.c-9", "z" * 32):
        assert accounts.add(name, None, WORDS).role is Role.OPERATOR


def test_a_taken_name_is_refused_and_keeps_its_password(accounts: Accounts) -> None:
    with pytest.raises(RefusedError, match="has an account already"):
        accounts.add("anna", None, OTHER)
    assert accounts.verify("anna", OTHER) is None


def test_the_first_account_is_an_admin(database: AccessDatabase) -> None:
    fresh = Accounts(database, Passwords(1, 8))
    for role in (Role.VIEWER, Role.OPERATOR):
        with pytest.raises(RefusedError, match="first account must be an admin"):
            fresh.add("anna", role, WORDS)
    assert fresh.add("anna", None, WORDS).role is Role.ADMIN


def test_the_last_admin_stays_while_there_are_accounts(accounts: Accounts) -> None:
    with pytest.raises(RefusedError, match="last admin and cannot be made viewer"):
        accounts.set_role("anna", Role.VIEWER)
    accounts.add("bob", Role.OPERATOR, WORDS)
    with pytest.raises(RefusedError, match="last admin and cannot be removed"):
        accounts.remove("anna")
    accounts.set_role("bob", Role.ADMIN)
    accounts.set_role("anna", Role.VIEWER)
    with pytest.raises(RefusedError, match="bob is the last admin"):
        accounts.remove("bob")
    accounts.remove("anna")
    accounts.remove("bob")
    assert accounts.count() == 0


def test_two_at_once_cannot_remove_both_admins(tmp_path: Path) -> None:
    first = Accounts(AccessDatabase(tmp_path), Passwords(1, 8))
    for name in ("anna", "bob", "carl"):
        first.add(name, Role.ADMIN, WORDS)
    second = Accounts(AccessDatabase(tmp_path))
    start = threading.Barrier(3)
    refused: list[str] = []

    def remove(accounts: Accounts, name: str) -> None:
        start.wait()
        try:
            accounts.set_role(name, Role.VIEWER)
        except RefusedError:
            refused.append(name)

    threads = [
        threading.Thread(target=remove, args=(accounts, name))
        for accounts, name in ((first, "anna"), (second, "bob"), (first, "carl"))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(refused) == 1
    assert [a.name for a in first.all() if a.role is Role.ADMIN] == refused


@pytest.mark.parametrize("change", ["password", "role", "end", "remove", "remove and add"])
def test_sessions_end_when_their_account_changes(
    accounts: Accounts, sessions: Sessions, change: str
) -> None:
    bob = accounts.add("bob", Role.OPERATOR, WORDS)
    his = sessions.open("bob", bob.role, bob.generation)
    hers = sessions.open("anna", Role.ADMIN, accounts.existing("anna").generation)
    guest = sessions.open("operator 1", Role.OPERATOR)
    assert sessions.is_open(his)
    if change == "password":
        accounts.set_password("bob", OTHER)
    elif change == "role":
        accounts.set_role("bob", Role.ADMIN)
    elif change == "end":
        accounts.end_sessions("bob")
    else:
        accounts.remove("bob")
        if change == "remove and add":
            assert accounts.add("bob", Role.OPERATOR, WORDS).generation > bob.generation
    assert not sessions.is_open(his)
    assert sessions.is_open(hers)
    assert sessions.is_open(guest)


def test_a_session_opened_with_an_older_generation_is_over_before_it_begins(
    accounts: Accounts, sessions: Sessions
) -> None:
    """The password changes between its check and the session."""
    verified = accounts.verify("anna", WORDS)
    assert verified is not None
    accounts.set_password("anna", OTHER)
    assert not sessions.is_open(sessions.open("anna", verified.role, verified.generation))


def test_another_process_ends_sessions_at_once(tmp_path: Path, clock: Clock) -> None:
    here, there = AccessDatabase(tmp_path), AccessDatabase(tmp_path)
    account = Accounts(there, Passwords(1, 8)).add("anna", None, WORDS)
    sessions = Sessions(here, clock)
    session = sessions.open("anna", account.role, account.generation)
    assert sessions.is_open(session)
    Accounts(there).end_sessions("anna")
    assert not sessions.is_open(session)


def test_signing_out_ends_one_session_and_a_restart_does_not_bring_it_back(
    tmp_path: Path, clock: Clock
) -> None:
    sessions = Sessions(AccessDatabase(tmp_path), clock)
    one, two = (sessions.open("operator 1", Role.OPERATOR) for _ in range(2))
    sessions.end(one)
    again = Sessions(AccessDatabase(tmp_path), clock)
    for of in (sessions, again):
        assert not of.is_open(one)
        assert of.is_open(two)
    sessions.end_guests("operator 1")
    assert not again.is_open(two)
    with pytest.raises(RefusedError, match="no one is signed in as 'operator 1'"):
        sessions.end_guests("operator 1")


def test_sessions_have_an_age(sessions: Sessions, clock: Clock) -> None:
    session = sessions.open("viewer 1", Role.VIEWER)
    clock.now += SESSION_AGE - 1
    assert sessions.is_open(session)
    clock.now += 1
    assert not sessions.is_open(session)
    sessions.write_seen()
    assert sessions.people() == []


def test_open_sessions_of_one_account_are_bounded(accounts: Accounts, sessions: Sessions) -> None:
    generation = accounts.existing("anna").generation
    made = [sessions.open("anna", Role.ADMIN, generation) for _ in range(PER_LABEL + 5)]
    assert sum(map(sessions.is_open, made)) == PER_LABEL
    assert sessions.is_open(made[-1])


def test_when_someone_was_last_seen_is_kept(
    accounts: Accounts, sessions: Sessions, clock: Clock
) -> None:
    session = sessions.open("anna", Role.ADMIN, accounts.existing("anna").generation)
    clock.now += 100
    assert sessions.is_open(session)
    (seen,) = sessions.people()
    assert (seen.label, seen.role, seen.sessions) == ("anna", Role.ADMIN, 1)
    assert seen.last_seen == clock.now
    sessions.end(session)
    assert accounts.existing("anna").last_seen == clock.now


def test_the_files_are_readable_by_their_owner_only(tmp_path: Path) -> None:
    folder = tmp_path / "web"
    Accounts(AccessDatabase(folder), Passwords(1, 8)).add("anna", None, WORDS)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for path in folder.iterdir():
        assert stat.S_IMODE(path.stat().st_mode) == 0o600, path


def test_a_file_open_to_others_is_closed_to_them(tmp_path: Path) -> None:
    (tmp_path / NAME).touch(0o644)
    AccessDatabase(tmp_path).close()
    assert stat.S_IMODE((tmp_path / NAME).stat().st_mode) == 0o600


def test_a_damaged_file_is_said_in_one_line(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"no database at all" * 100)
    with pytest.raises(StorageError, match=r"access\.sqlite cannot be used") as caught:
        AccessDatabase(tmp_path)
    assert "\n" not in str(caught.value)


def test_counting_makes_no_file(tmp_path: Path) -> None:
    assert count_accounts(tmp_path) == 0
    assert not list(tmp_path.iterdir())
    Accounts(AccessDatabase(tmp_path), Passwords(1, 8)).add("anna", None, WORDS)
    assert count_accounts(tmp_path) == 1


def _hash_of(database: AccessDatabase, name: str) -> str:
    from web.access.database import AccountRow

    with database.reading() as session:
        row = session.get(AccountRow, name)
        assert row is not None
        return row.password
