"""Pages of others against every port of a laboratory, in a browser that is signed in as its admin.

    python -m benchmarks foreign_page [--smoke]

One page is of another host, one of this host and another port, to which a browser sends the same
cookies. Each posts to every port that listens and to every route, opens every websocket, submits
forms, frames the console, and goes to a sign-in link of a viewer.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from benchmarks.harness import CHROMIUM, Report, Row, Size, Target
from benchmarks.link import hostile_bytes
from benchmarks.safety.flight_logs import MOVED, moved, newest_truth
from benchmarks.safety.hostile_doors import (
    is_hovering,
    laboratory,
    listening,
    page_sockets,
    people,
    routes,
)
from benchmarks.safety.laboratory import Laboratory

FOREIGN = "evil.test"
SCRIPT = Path(__file__).with_suffix(".js")
LONGEST = 180_000
"""Longest time, in ms, of a step in the browser."""


class _Empty(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>elsewhere</title><body>")

    def log_message(self, *_: Any) -> None:
        """Print nothing."""


@contextmanager
def elsewhere() -> Iterator[int]:
    """Serve an empty page; yield its port."""
    with ThreadingHTTPServer(("127.0.0.1", 0), _Empty) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_port
        server.shutdown()


def tried(lab: Laboratory, context: Any, address: str, ports: list[int]) -> dict[str, Any]:
    """Attack from a page; return what was tried and what got through."""
    made = lab.browser.post("/api/invitations", json={"role": "viewer"})
    made.raise_for_status()
    link = str(made.json()["url"])
    page = context.new_page()
    page.set_default_timeout(LONGEST)
    page.goto(address)
    words = {
        "host": "127.0.0.1",
        "ports": ports,
        "page": lab.base,
        "routes": routes(lab),
        "sockets": page_sockets(lab),
        "message": list(b"".join(hostile_bytes.doors()[4].valid)),
        "link": link,
    }
    found: dict[str, Any] = page.evaluate(SCRIPT.read_text(), words)
    found["framed"] = [
        frame.url for frame in page.frames[1:] if frame.url.startswith(lab.base) and frame.content()
    ]
    page.evaluate("link => { location.href = link }", link)
    page.wait_for_url(f"{lab.base}/**")
    page.wait_for_load_state("networkidle")
    own = context.new_page()
    found["role"] = own.goto(f"{lab.base}/api/session").json().get("role")
    own.close()
    page.close()
    return found


def run(size: Size = Size.FULL) -> Report:
    """Attack from both pages. Raises QuadlabError when a laboratory does not start."""
    from playwright.sync_api import sync_playwright

    report = Report(
        "foreign_page",
        "Pages of others against every port",
        ["Chromium, signed in as admin; the vehicle hovers at 1 m; MAVLink listens, too"],
    )
    with laboratory() as (lab, _, tcp), elsewhere() as port, sync_playwright() as playwright:
        ports = [*(number for _, number, is_stream in listening(lab) if is_stream), tcp]
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=["--no-sandbox", f"--host-resolver-rules=MAP {FOREIGN} 127.0.0.1"],
        )
        context = browser.new_context()
        context.set_default_timeout(LONGEST)
        signing = context.new_page()
        signing.goto(lab.new_link())
        signing.wait_for_selector("#behaviors button")
        signing.close()
        known, since = people(lab), newest_truth(lab.data)
        rows: list[dict[str, Any]] = []
        for host in size.some((FOREIGN, "127.0.0.1"), 2):
            found = tried(lab, context, f"http://{host}:{port}/", ports)
            found |= {"people": abs(people(lab) - known), "hovers": is_hovering(lab)}
            rows.append(found)
            report.rows.append(
                Row(
                    f"a page of {host}",
                    {
                        "ports": float(len(ports)),
                        "requests": float(found["requests"]),
                        "forms": float(found["forms"]),
                        "sockets opened": float(len(found["opened"])),
                        "frames shown": float(len(found["framed"])),
                        "still": str(found["role"]),
                        "hovers": "yes" if found["hovers"] else "**no**",
                    },
                )
            )
            report.notes += [f"{host}: {one}" for one in (*found["opened"], *found["framed"])]
        away = moved(lab.data, since)
        browser.close()
    report.targets = [
        Target("sockets opened", sum(len(one["opened"]) for one in rows), 0),
        Target("frames shown", sum(len(one["framed"]) for one in rows), 0),
        Target("people signed in or out", sum(one["people"] for one in rows), 0),
        Target("browsers that are no admin's now", sum(one["role"] != "admin" for one in rows), 0),
        Target("flights that do not hover", sum(not one["hovers"] for one in rows), 0),
        Target("way from its place, m", away, MOVED),
    ]
    return report
