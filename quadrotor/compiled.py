"""`@compiled`: numba's njit with a cache keyed by everything a function was compiled from.

numba's own cache checks only the file of the function. A function that it calls, or a constant
imported from another file, may have changed since, and old machine code would still fly. Here the
machine code of a module is stored under a digest of its source and of every source of this project
that it imports, directly or indirectly. Division by zero gives inf or NaN, as in numpy, and is
then subject to every limit before the motors, instead of raising an exception within a tick.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar, cast, overload

import numba
from numba.core.caching import FunctionCache
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys

from quadrotor.checkout import IMPORTED_FROM, PREFIX, ROOT

Function = TypeVar("Function", bound=Callable[..., object])

VERSIONS = 3
"""Number of versions of a module that are stored, so that two branches do not evict each other."""

_IMPORT = re.compile(
    rb"^\s*(?:from|import) "
    rb"((?:quadlab\.)?(?:quadrotor|control|estimation|bearing_sim|vehicle|vehicle_link|extensions)\b[\w.]*)",
    re.M,
)


class CompilerlessCache(FunctionCache):
    """A function's compiled code on disk, loaded without importing numba's compiler.

    numba's `FunctionCache` imports the compiler before it loads anything, which costs each process
    about 25 MB; a function that has to be compiled imports it anyway.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


class Inner(CPUDispatcher):
    """A compiled function that other compiled functions call.

    Without entry points for Python and C it compiles in two thirds of the time. Python may still
    call it, for a test or at a prompt: the first call then compiles an entry point.
    """

    def __call__(self, *arguments: Any) -> Any:
        entry = self.__dict__.get("_entry")
        if entry is None:
            inner = self
            entry = self._entry = numba.njit(lambda *a: inner(*a))  # noqa: PLW0108 - the entry
        return entry(*arguments)


@overload
def compiled(function: Function) -> Function: ...
@overload
def compiled(
    *, nogil: bool = ..., inner: bool = ..., pointer: bool = ...
) -> Callable[[Function], Function]: ...
def compiled(
    function: Any = None, *, nogil: bool = False, inner: bool = False, pointer: bool = False
) -> Any:
    """Return `function` compiled at its first call, or loaded if this very source was compiled
    before.

    Use it without arguments, or with options:

    Args:
        nogil: release the GIL, so that other Python threads run during the call.
        inner: for functions called by compiled functions, not by time-critical Python; see `Inner`.
        pointer: for functions that are arguments of compiled functions.
    """
    if function is None:
        return partial(compiled, nogil=nogil, inner=inner, pointer=pointer)
    config: Any = numba.config
    chosen = config.CACHE_DIR
    config.CACHE_DIR = str(_folder(function.__module__, chosen))
    options: dict[str, Any] = {
        "error_model": "numpy",
        "nogil": nogil,
        "no_cfunc_wrapper": not pointer,
        "no_cpython_wrapper": inner,
    }
    try:
        out = numba.njit(**options)(function)
        out._cache = CompilerlessCache(function)  # type: ignore[no-untyped-call]
    finally:
        config.CACHE_DIR = chosen
    if inner:
        out.__class__ = Inner
    return out


def direct(function: Function, *arguments: object) -> Function:
    """Return the machine code of a compiled function for arguments of these types, compiled or
    loaded now, for a caller whose arguments always have them.

    A call of the function itself first finds out the types, which takes longer than most laws:
    0.3 µs for each record. The machine code raises TypeError for a record of another size, and
    does not notice one of another type.
    """
    dispatcher: Any = function
    return cast(Function, dispatcher.compile(tuple(map(numba.typeof, arguments))))


def digest(module: str) -> str:
    """Return the digest of the sources of `module` and of all that it imports from this project."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting.extend(_source(name)[1])
    hashes = b"".join(_source(name)[0] for name in sorted(found))
    return hashlib.sha256(hashes).hexdigest()[:16]


@cache
def _source(module: str) -> tuple[bytes, tuple[str, ...]]:
    """Return a module's hash and project imports; a package counts as importing its modules."""
    path = IMPORTED_FROM.joinpath(*module.split("."))
    file = getattr(sys.modules.get(module), "__file__", None) or path.with_suffix(".py")
    if path.is_dir():
        files = sorted(path.glob("*.py"))
        inside = tuple(f"{module}.{f.stem}" for f in files if f.stem != "__init__")
        return b"", inside
    try:
        text = Path(file).read_bytes()
    except FileNotFoundError:  # defined at a prompt: there is no file
        return b"", ()
    imports = tuple(sorted({name.decode() for name in _IMPORT.findall(text)}))
    return hashlib.sha256(text).digest(), imports


@cache
def _folder(module: str, chosen: str) -> Path:
    """Return the folder of this module's machine code; `chosen` is the user's NUMBA_CACHE_DIR or
    empty.
    """
    root = Path(chosen) if chosen else _default_root()
    folder = root / f"{module}-{digest(module)}"
    if not folder.exists():
        old = sorted(root.glob(f"{module}-*"), key=_age)
        for one in old[VERSIONS - 1 :]:
            shutil.rmtree(one, ignore_errors=True)
    return folder


@cache
def _default_root() -> Path:
    """Return a folder next to Python's compiled files; in the user's cache for a wheel, which is
    removed without it, and where it cannot be written.
    """
    root = ROOT / "__pycache__" / "kernels"
    try:
        if not PREFIX:
            root.mkdir(parents=True, exist_ok=True)
            return root
    except OSError:
        pass
    import platformdirs

    return platformdirs.user_cache_path("quadlab") / "kernels"


def _age(folder: Path) -> float:
    try:
        return -folder.stat().st_mtime
    except FileNotFoundError:  # another process was faster
        return 0.0


def is_cached(module: str) -> bool:
    """Return whether machine code of this very source of `module`, as a checkout names it, is
    stored, so that its functions will be loaded.
    """
    return any(_folder(PREFIX + module, numba.config.CACHE_DIR).glob("*/*.nbc"))  # type: ignore[attr-defined]
