"""One package under both of its names: `vehicle` of a checkout is `quadlab.vehicle` of a wheel.

So a user's file runs in both. A name that another distribution has, as python-control has
`control`, stays that distribution's; only modules that it does not have, such as
`control.trajectories`, are ours.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, spec_from_loader
from types import ModuleType

from quadrotor.checkout import PACKAGES, PREFIX

OURS = "quadlab."


class TwoNames(MetaPathFinder, Loader):
    """A finder of modules by the name that they have in the other kind of copy.

    Args:
        is_first: whether it is asked before all others. Then it answers only for what is in a
            package of ours, whose folder others would search and load a second time.
    """

    def __init__(self, is_first: bool) -> None:
        self._is_first = is_first

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how to import this name, None if it is not to be found here."""
        here, parent = _name_here(fullname), fullname.rpartition(".")[0]
        if here == fullname or here.removeprefix(OURS).split(".")[0] not in PACKAGES:
            return None
        is_inside = parent and sys.modules.get(parent) is sys.modules.get(_name_here(parent))
        if (self._is_first and not is_inside) or find_spec(here) is None:
            return None
        return spec_from_loader(fullname, self)

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to `exec_module`, which needs no new module."""

    def exec_module(self, module: ModuleType) -> None:
        """Give the name of the new module to the one that exists."""
        sys.modules[module.__name__] = import_module(_name_here(module.__name__))


def _name_here(name: str) -> str:
    return PREFIX + name.removeprefix(OURS)


def answer_to_both() -> None:
    """Let this process import our packages by both names."""
    sys.meta_path.insert(0, TwoNames(is_first=True))
    sys.meta_path.append(TwoNames(is_first=False))
