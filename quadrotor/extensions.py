"""The extensions of this installation: those of quadlab itself, and those of installed packages.

A package offers an extension by an entry point of the group `quadlab.extensions`, whose value names
the declaration, as `my_package.extension:EXTENSION`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Iterable, Iterator
from functools import lru_cache, partial
from importlib import import_module
from importlib.util import find_spec
from operator import attrgetter
from typing import Any, Generic, NamedTuple, TypeVar

from quadrotor.checkout import PREFIX
from quadrotor.errors import UsageError
from quadrotor.extension import PROTOCOL, Extension, Offer
from quadrotor.packaged_files import packaged

GROUP = "quadlab.extensions"
FOLDER = f"{PREFIX}extensions"
BUILT_IN = (
    "batches",
    "betaflight",
    "campaigns",
    "checklist",
    "comparison",
    "crazyflie",
    "documents",
    "explanation",
    "export",
    "fmu",
    "formations",
    "foxglove",
    "identification",
    "importers",
    "laws",
    "link_test",
    "mavlink",
    "mocap",
    "offline",
    "replay",
    "reports",
    "tuning",
    "vision",
)
"""The folders of `extensions`. A folder that was taken away is no error."""

Kind = TypeVar("Kind", bound=Offer)


class Offered(NamedTuple, Generic[Kind]):
    """An offer, and the extension that makes it."""

    offer: Kind
    package: str
    """Package to which the target of the offer is relative."""
    extension: Extension | None = None

    def load(self, target: str = "") -> Any:
        """Return the code of the offer, or that of another target of it.

        Raises UsageError if an extension's code cannot be imported; a part of quadlab itself raises
        its own error.
        """
        module, _, name = (target or self.offer.target).partition(":")
        try:
            return attrgetter(name)(import_module(module, self.package))
        except Exception as error:
            if self.extension is None:
                raise
            raise UsageError(self._reason(self.extension, error)) from error

    def _reason(self, extension: Extension, error: Exception) -> str:
        one = f"extension {extension.name}: {self.offer.kind} {self.offer.name}"
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        libraries = extension.libraries
        if missing is not None and (top := missing.partition(".")[0]) in libraries:
            return f"{one} needs the package {top}; install it with {libraries[top]}"
        return f"{one} cannot be imported: {_told(error)}; mend it, or remove the extension"


class Registry:
    """Extensions by name, and what is wrong with those that were left out.

    Args:
        declared: where each declaration is, for people; the package to which its targets are
            relative; and a function that imports it.

    Attributes:
        problems: one line for each declaration or offer that is left out.
    """

    def __init__(self, declared: Iterable[tuple[str, str, Callable[[], object]]]) -> None:
        self.problems: dict[str, None] = {}
        self._found: dict[str, tuple[Extension, str]] = {}
        for place, package, read in declared:
            try:
                extension = _checked(read())
                if extension.name in self._found:
                    raise UsageError("another extension has this name; rename one of them")
            except Exception as error:  # code of others: whatever it raises, all else runs
                self._leave_out(f"extension {place} is left out: {_told(error)}")
                continue
            self._found[extension.name] = extension, package
        while lacking := [
            (name, need)
            for name, (extension, _) in self._found.items()
            for need in extension.needs
            if need not in self._found
        ]:
            name, need = lacking[0]
            del self._found[name]
            self._leave_out(
                f"extension {name} is left out: it needs the extension {need}, which is not "
                "installed; install it, or remove this one"
            )

    @property
    def extensions(self) -> list[Extension]:
        """Return the extensions in use."""
        return [extension for extension, _ in self._found.values()]

    def offers(self, kind: type[Kind], taken: Collection[str] = ()) -> dict[str, Offered[Kind]]:
        """Return what is offered of a kind, by name.

        Args:
            taken: names that quadlab itself has. An offer with one of these, or with the name of an
                earlier offer, is left out, and is one of the problems.
        """
        found: dict[str, Offered[Kind]] = {}
        for offered in self._all(kind):
            name, extension = offered.offer.name, offered.extension
            assert extension is not None
            if name in taken or name in found:
                other = found[name].extension if name in found else None
                has = f"the extension {other.name}" if other else "quadlab itself"
                self._leave_out(
                    f"extension {extension.name}: its {kind.kind} {name} is left out, because "
                    f"{has} has one of this name; rename it"
                )
            else:
                found[name] = offered
        return found

    def _all(self, kind: type[Kind]) -> Iterator[Offered[Kind]]:
        for extension, package in self._found.values():
            for offer in extension.offers:
                if isinstance(offer, kind):
                    yield Offered(offer, package, extension)

    def _leave_out(self, line: str) -> None:
        self.problems[line] = None


def _checked(found: object) -> Extension:
    """Return a declaration that can be used. Raises UsageError."""
    if not isinstance(found, Extension):
        raise UsageError(
            f"its declaration is of type {type(found).__name__}; write EXTENSION = Extension(…)"
        )
    if found.protocol != PROTOCOL:
        advice = "update the extension" if found.protocol < PROTOCOL else "update quadlab"
        raise UsageError(
            f"it is written for protocol {found.protocol}, quadlab has {PROTOCOL}; {advice}"
        )
    if not found.name.isidentifier():
        raise UsageError(f"its name is {found.name!r}; use letters, digits and _")
    for offer in found.offers:
        module, _, name = offer.target.partition(":")
        if not module or not (name or offer.is_file):
            raise UsageError(
                f"the target of its {offer.kind} {offer.name} is {offer.target!r}; write "
                '".module:name"'
            )
    return found


def _told(error: Exception) -> str:
    if isinstance(error, UsageError):
        return str(error)
    return f"{type(error).__name__}: {error}".splitlines()[0]


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return the extensions of this installation; their declarations are read at the first call."""
    return Registry((*_built_in(), *_installed()))


def _built_in() -> Iterator[tuple[str, str, Callable[[], object]]]:
    for name in BUILT_IN:
        package = f"{FOLDER}.{name}"
        if find_spec(FOLDER) is not None and find_spec(package) is not None:
            yield name, package, partial(_declaration, package)


def _declaration(package: str) -> object:
    return import_module(f"{package}.extension").EXTENSION


def _installed() -> Iterator[tuple[str, str, Callable[[], object]]]:
    for point in packaged(GROUP):
        of = f" of {point.dist.name}" if point.dist is not None else ""
        yield f"{point.name}{of}", point.module.rpartition(".")[0] or point.module, point.load


def tell_problems() -> None:
    """Print on stderr which extensions were left out, and why."""
    for line in registry().problems:
        print(f"quadlab: {line}", file=sys.stderr)
