"""Pages of reference that are written from the code when the site is built, and kept nowhere."""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock, patch

WIDTH = "100"
"""Columns of the help texts."""


def command_line() -> str:
    """Return the page of the commands: the help of each as the command line prints it."""
    import tyro

    from quadlab.commands import link, log
    from quadlab.commands.table import commands, examples_of, overview

    def helped(command: Any, *words: str) -> str:
        text = io.StringIO()
        with (
            contextlib.redirect_stdout(text),
            contextlib.suppress(SystemExit),
            patch.dict(os.environ, COLUMNS=WIDTH),
        ):
            tyro.cli(
                command,
                prog=f"quadlab {words[0]}",
                args=[*words[1:], "--help"],
                config=(tyro.conf.FlagCreatePairsOff,),
            )
        return _block(text.getvalue())

    parts = ["# Command line\n", _block(overview())]
    for name, offered in commands().items():
        command = offered.load()
        parts += [f"\n## quadlab {name}\n", helped(command, name), _block(examples_of(name))]
        for word in {"log": log.ACTIONS, "link": link.ACTIONS}.get(name, ()):
            parts += [f"\n### quadlab {name} {word}\n", helped(command, name, word)]
    return "\n".join(parts)


def http_routes() -> str:
    """Return the page of the web process's routes, as its own OpenAPI description has them."""
    from web.access.requester import admin_of, operator_of
    from web.access.roles import Role
    from web.app import create_app
    from web.features import built_in, of_extensions

    features = (*built_in(), *of_extensions(MagicMock()))
    app = create_app(MagicMock(), MagicMock(), features)  # routes are made, none is called
    described = app.openapi()
    least: dict[tuple[str, str], Role] = {}
    for route in app.routes:
        for method in getattr(route, "methods", None) or ():
            calls = _calls(getattr(route, "dependant", None))
            role = Role.ADMIN if admin_of in calls else Role.OPERATOR
            least[getattr(route, "path", ""), method.lower()] = (
                role if {admin_of, operator_of} & calls else Role.VIEWER
            )
    parts = [
        "# HTTP routes\n",
        "A running laboratory describes itself at `/api/openapi.json`; `quadlab.connect` calls "
        "these routes for a script. With several vehicles each route is also at `/v/NAME/…`. "
        'A refusal has the body `{"error": "one line"}`.',
    ]
    group = ""
    for path, operations in sorted(described["paths"].items()):
        for method, operation in operations.items():
            if group != (group := path.split("/")[2]):
                parts.append(f"\n## {group}")
            parts += [
                f"\n### `{method.upper()} {path}`\n",
                f"Least role: {least[path, method]}.\n",
                operation.get("description", ""),
                _arguments(operation, described),
            ]
    return "\n".join(parts)


def topics() -> str:
    """Return the page of topics, services and the definitions of our messages."""
    from vehicle_link.messages.store import FOLDER, ros_name
    from vehicle_link.topics.table import SERVICES, TOPICS

    rows = [
        (
            f"`{one.name}`",
            _type(ros_name(one.type_name)),
            one.sender,
            f"{one.rate:g} Hz" if one.rate else "on change",
            "yes" if one.on_radio else "",
            "yes" if one.recorded else "",
            one.priority,
            "reliable" if one.qos.reliable else "newest",
        )
        for one in TOPICS.values()
    ]
    head = ("topic", "type", "sender", "rate", "radio", "recorded", "priority", "delivery")
    parts = [
        "# Topics and messages\n",
        "Names are relative to the vehicle (`/quad1/state`) unless they begin with a slash. "
        "*Radio*: the topic crosses the radio link; others stay on the station's computer. "
        "*Recorded*: the station writes it into each run as it comes; it also writes "
        "`marks`, and what telemetry carries as `state`, `reference`, `actuators` and `imu`.\n",
        _table(head, rows),
        "\n## Services\n\nThe vehicle's are `/quad1/NAME`, the station's `/quad1/station/NAME`.\n",
        _table(("service", "type"), [(f"`{k}`", _type(ros_name(v))) for k, v in SERVICES.items()]),
        "\n## Definitions",
    ]
    for file in sorted(FOLDER.glob("quadlab_msgs/*/*.[ms][sr][gv]")):
        parts += [f"\n### {file.stem}\n", _block(file.read_text())]
    return "\n".join(parts)


def file_format() -> str:
    """Return the page of a run's files: names, metadata and the columns of each recorded topic."""
    from flight_log import run_folder, writer
    from flight_log.index import RECOVERED_METADATA
    from flight_log.provenance import provenance
    from vehicle_link.messages.store import ros_name
    from vehicle_link.messages.units import numbers, unit_of
    from vehicle_link.topics.table import TOPICS

    parts = [
        "# File format\n",
        run_folder.__doc__ or "",
        "\nEach file is [MCAP](https://mcap.dev/spec) with lz4 chunks, CDR messages and ROS 2 "
        "schemas, so any reader of MCAP opens it. `publish_time` is the source's stamp, `log_time` "
        "the time of reception, both in ns. `parameters.json` and `calibrations.json` are "
        "attached as they were at the start.\n",
        "## Metadata\n",
        _table(
            ("record", "content"),
            [
                (f"`{writer.RUN_METADATA}`", "run, vehicle, " + ", ".join(provenance())),
                (f"`{writer.FILLED_METADATA}`", "in `merged.mcap`: files, what was filled"),
                (f"`{RECOVERED_METADATA}`", "the file was repaired"),
            ],
        ),
        "\n## Columns\n\nThe numbers of each topic, as exports, charts and `quadlab.open` name "
        "them; `[k]` counts from 0. Texts are left out here.",
    ]
    for one in TOPICS.values():
        found = [
            number
            for number in numbers(one.type_name, members=1)
            if all(step == 0 for step in number.path if isinstance(step, int))
        ]
        if not (one.recorded or one.rate >= 100) or not found:
            continue
        rows = [(f"`{_column(n.path)}`", unit_of(n.fields)) for n in found]
        parts += [f"\n### {one.name}\n", f"`{ros_name(one.type_name)}`\n"]
        parts.append(_table(("column", "unit"), rows))
    return "\n".join(parts)


def extensions() -> str:
    """Return the page of the built-in extensions: what each offers, and how it was tried."""
    from quadrotor.extensions import BUILT_IN, registry

    parts = [
        "# Extensions\n",
        "The folders of `extensions/`. Each can be left out; "
        "[Extensions](../extending/extensions.md) says how one is made. **Tried with**: "
        "*simulated*: with a simulator of ours; *peer*: with a program or data of others; "
        "*firmware*: with the firmware of a board in a process; *hardware*: with the device "
        "itself, where date and place stand.",
    ]
    for one in registry().extensions:
        if one.name not in BUILT_IN:
            continue
        title = f"[{one.name}](../{one.docs})" if one.docs else one.name
        parts.append(f"\n## {title}\n\n{one.summary}.\n")
        offered = [(offer.kind, f"`{offer.name}`") for offer in one.offers]
        tried = [("tried with", f"{judged.evidence}: {judged.by}") for judged in one.judged]
        needs = [("needs", f"`{name}`: {how}") for name, how in one.libraries.items()]
        parts.append(_table(("", ""), [*offered, *tried, *needs]))
    return "\n".join(parts)


PAGES: dict[str, Callable[[], str]] = {
    "extensions": extensions,
    "command_line": command_line,
    "http": http_routes,
    "topics": topics,
    "file_format": file_format,
}
"""Pages by the names of their files."""


def code_page(path: str, file: Path) -> str:
    """Return a page that shows a file of the repository."""
    language = {".py": "python", ".js": "js", ".c": "c", ".toml": "toml"}.get(file.suffix, "")
    return f"# {path}\n\n{_block(file.read_text(), language)}"


def _block(text: str, language: str = "text") -> str:
    lines = [line.rstrip() for line in text.strip("\n").splitlines()]
    return "\n".join([f"````{language}", *lines, "````\n"]) if lines else ""


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    titles = list(head)
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in lines)


def _type(name: str) -> str:
    """Return a type, with a link to its definition where it is ours."""
    package, _, stem = name.replace("/msg/", "/").replace("/srv/", "/").partition("/")
    return f"[{stem}](#{stem.lower()})" if package == "quadlab_msgs" else f"`{package}/{stem}`"


def _column(path: tuple[str | int, ...]) -> str:
    text = "".join("[k]" if isinstance(step, int) else f".{step}" for step in path)
    return text.removeprefix(".")


def _calls(dependant: Any) -> set[Any]:
    """Return every function that an endpoint depends on."""
    found: set[Any] = set()
    for one in dependant.dependencies if dependant else ():
        found |= {one.call, *_calls(one)}
    return found


def _arguments(operation: dict[str, Any], described: dict[str, Any]) -> str:
    """Return the table of an operation's parameters and the fields of its body; "" without any."""
    rows = [
        (f"`{one['name']}`", one["in"], _kind(one["schema"]), "" if one["required"] else "optional")
        for one in operation.get("parameters", ())
        if one["in"] != "header"
    ]
    for content in operation.get("requestBody", {}).get("content", {}).values():
        name = content.get("schema", {}).get("$ref", "").rsplit("/", 1)[-1]
        body = described.get("components", {}).get("schemas", {}).get(name, {})
        required = body.get("required", ())
        for field, schema in body.get("properties", {}).items():
            needed = "" if field in required else "optional"
            rows.append((f"`{field}`", "body", _kind(schema), needed))
    return "\n" + _table(("name", "in", "value", ""), rows) if rows else ""


def _kind(schema: dict[str, Any]) -> str:
    """Return the type of a value and what bounds it, in words."""
    if choices := schema.get("enum"):
        return ", ".join(map(str, choices))
    several = [_kind(one) for one in schema.get("anyOf", ())]
    kind = " or ".join(several) or str(schema.get("type", "any"))
    if "items" in schema:
        kind = f"list of {_kind(schema['items'])}"
    low, high = schema.get("minimum"), schema.get("maximum")
    return f"{kind}, {low:g} … {high:g}" if low is not None and high is not None else kind
