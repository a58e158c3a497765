"""Write the stubs of the messages from the .msg and .srv files and the tables of topics and
services: `.venv/bin/python scripts/message_types.py`.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable, Iterator
from typing import Any

from rosbags.interfaces import Nodetype

from vehicle_link.messages.store import FOLDER, ros_name, stored_name, typestore
from vehicle_link.topics.table import SERVICES, TOPICS

RECORDS = FOLDER / "records.pyi"
TABLES = FOLDER.parent / "topics" / "typed_tables.pyi"
MADE = "# Made by scripts/message_types.py of the .msg and .srv files and the tables of topics.\n"
ANSWER, PERSONAL = {"accepted", "reason"}, {"request_id", "requester"}
INTEGERS = ("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
SCALARS = {"bool": "bool", "string": "str", "float32": "float", "float64": "float"} | dict.fromkeys(
    (*INTEGERS, "byte", "char"), "int"
)


def class_name(stored: str) -> str:
    """Return the class of a type: `nav_msgs/msg/Odometry` → `Odometry`, requests and responses of
    services without the underscore.
    """
    return stored.rpartition("/")[2].replace("_", "")


def described() -> list[str]:
    """Return the stored names of the types of the files here and the tables, and all within."""
    todo = [f"{path.parts[-3]}/msg/{path.stem}" for path in FOLDER.glob("*/msg/*.msg")]
    todo += [
        f"{path.parts[-3]}/srv/msg/{path.stem}_{part}"
        for path in FOLDER.glob("*/srv/*.srv")
        for part in ("Request", "Response")
    ]
    todo += [stored_name(row.type_name) for row in TOPICS.values()]
    found: set[str] = set()
    while todo:
        name = todo.pop()
        if name not in found:
            found.add(name)
            todo += [nested for _, entry in _fields(name) if (nested := _nested(entry))]
    if len({class_name(name) for name in found}) < len(found):
        raise ValueError("two message types have the same name")
    return sorted(found, key=class_name)


def _fields(stored: str) -> list[tuple[str, Any]]:
    return list(typestore().fielddefs[stored][1])


def _nested(entry: Any) -> str:
    kind, details = entry
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return _nested(details[0])
    return str(details) if kind == Nodetype.NAME else ""


def _annotation(entry: Any) -> str:
    kind, details = entry
    if kind == Nodetype.NAME:
        return class_name(details)
    if kind == Nodetype.BASE:
        return SCALARS[details[0]]
    item_kind, item = details[0]
    if item_kind == Nodetype.NAME or item[0] == "string":
        return f"list[{_annotation(details[0])}]"
    dtype = {"byte": "uint8", "char": "uint8", "bool": "bool_"}.get(item[0], item[0])
    return f"NDArray[np.{dtype}]"


def _class(stored: str) -> Iterator[str]:
    entries = dict(_fields(stored))
    entries.pop("structure_needs_at_least_one_member", None)
    base = "Message"
    if stored.endswith("_Request"):
        base = f"Request[{class_name(stored).removesuffix('Request')}Response]"
        if entries.keys() >= PERSONAL:
            base = f"Personal{base}"
            entries = {n: e for n, e in entries.items() if n not in PERSONAL}
    if entries.keys() >= ANSWER:
        base, entries = "Answer", {n: e for n, e in entries.items() if n not in ANSWER}
    fields = [f"    {name}: {_annotation(entry)}" for name, entry in entries.items()]
    yield f"class {class_name(stored)}({base}):" + ("" if fields else " ...")
    yield from fields
    yield ""


def _overloads(first: str, cases: Iterable[tuple[str, str]]) -> Iterator[str]:
    for given, result in cases:
        yield "    @overload"
        yield f"    def {first}{given}) -> {result}: ..."


def _by_literal(first: str, more: str, names: Iterable[str]) -> Iterator[str]:
    yield from _overloads(
        first,
        (
            (f'Literal["{ros_name(name).replace("/msg/", "/")}"]{more}', class_name(name))
            for name in names
        ),
    )


def records() -> str:
    """Return the stub of the messages."""
    names = described()
    lines = [
        "from dataclasses import Field",
        "from typing import ClassVar, Generic, Literal, Protocol, TypeVar, overload",
        "",
        "import numpy as np",
        "from numpy.typing import NDArray",
        "",
        "class Message:",
        '    """A message of any type."""',
        "    __msgtype__: ClassVar[str]",
        "    __dataclass_fields__: ClassVar[dict[str, Field[object]]]",
        "",
        "class Answer(Message):",
        '    """A response of a service that may refuse."""',
        "    accepted: bool",
        "    reason: str",
        "",
        'M_co = TypeVar("M_co", bound=Message, covariant=True)',
        "",
        "class Request(Message, Generic[M_co]):",
        '    """A request of a service, whose responses are of this type."""',
        "",
        "class PersonalRequest(Request[M_co]):",
        '    """A request in the name of a person."""',
        "    request_id: str",
        "    requester: str",
        "",
        "class TypeName(str, Generic[M_co]):",
        '    """The name of a message type, in the tables."""',
        "",
        *(line for name in names for line in _class(name)),
        "class ServiceName(str, Generic[M_co]):",
        '    """The name of a service, whose responses are of this type."""',
        "",
        "class Decode(Protocol):",
        *_by_literal("__call__(self, payload: bytes | memoryview, type_name: ", "", names),
        "    @overload",
        "    def __call__("
        "self, payload: bytes | memoryview, type_name: TypeName[M_co]) -> M_co: ...",
        "    @overload",
        "    def __call__(self, payload: bytes | memoryview, type_name: str) -> Message: ...",
        "",
        "class New(Protocol):",
        *_by_literal("__call__(self, type_name: ", ", **fields: object", names),
        "    @overload",
        "    def __call__(self, type_name: str, **fields: object) -> Message: ...",
        "",
    ]
    return _formatted(lines)


def tables() -> str:
    """Return the stub of the tables of topics and services."""
    rows = [
        (f'Literal["{row.name}"]', f"records.{class_name(row.type_name)}")
        for row in TOPICS.values()
    ]
    services = [
        (f'Literal["{name}"]', f"records.{class_name(kind)}Response")
        for name, kind in SERVICES.items()
    ]
    lines = [
        "# What is asked by a name that is not known here may refuse: all services but two do.",
        '# mypy: disable-error-code="overload-overlap"',
        "from collections.abc import Iterator, Mapping",
        "from typing import Generic, Literal, Protocol, TypeVar, overload",
        "",
        "from vehicle_link.messages import records",
        "from vehicle_link.messages.records import Answer, Message, ServiceName, TypeName",
        "from vehicle_link.topics.table import Topic",
        "",
        'M_co = TypeVar("M_co", bound=Message, covariant=True)',
        "",
        "class TopicOf(Topic, Generic[M_co]):",
        "    type_name: TypeName[M_co]",
        "",
        "class Topics(Mapping[str, Topic]):",
        "    def __iter__(self) -> Iterator[str]: ...",
        "    def __len__(self) -> int: ...",
        *_overloads("__getitem__(self, topic: ", [(of, f"TopicOf[{made}]") for of, made in rows]),
        "    @overload",
        "    def __getitem__(self, topic: str) -> Topic: ...",
        "",
        "class Services(Mapping[str, str]):",
        "    def __iter__(self) -> Iterator[str]: ...",
        "    def __len__(self) -> int: ...",
        *_overloads(
            "__getitem__(self, service: ", [(of, f"ServiceName[{made}]") for of, made in services]
        ),
        "    @overload",
        "    def __getitem__(self, service: str) -> ServiceName[Answer]: ...",
        "",
        "class Newest(Protocol):",
        '    """Return the newest message of a topic, None where there is none."""',
        *_overloads("__call__(self, topic: ", [(of, f"{made} | None") for of, made in rows]),
        "    @overload",
        "    def __call__(self, topic: str) -> Message | None: ...",
        "",
        "class Ask(Protocol):",
        '    """Ask a service by its name with these fields, and return what it answers."""',
        *_overloads(
            "__call__(self, service: ", [(f"{of}, **fields: object", made) for of, made in services]
        ),
        "    @overload",
        "    def __call__(self, service: str, **fields: object) -> Answer: ...",
        "",
    ]
    return _formatted(lines)


def _formatted(lines: list[str]) -> str:
    return subprocess.run(
        [sys.executable, "-m", "ruff", "format", "--stdin-filename", "made.pyi", "-"],
        input=MADE + "\n".join(lines),
        capture_output=True,
        text=True,
        check=True,
        cwd=FOLDER.parents[1],
    ).stdout


STUBS = {RECORDS: records, TABLES: tables}


def main() -> None:
    for path, made in STUBS.items():
        path.write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
