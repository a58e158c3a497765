"""Start: ports, imports, and the page's own tables against the code they describe."""

from __future__ import annotations

import math
import re
import socket
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from control.behaviors import machine
from control.behaviors.arguments import ARGUMENTS
from control.behaviors.behavior import NoArguments
from quadrotor.checkout import ROOT
from quadrotor.errors import LinkError, UsageError
from quadrotor.parameters import ParameterStore
from web import app
from web.commands.behaviors import described
from web.live.sockets import listen
from web.process import print_link

STATIC = Path(app.__file__).parent / "static"


def test_a_taken_port_is_one_clear_line() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(LinkError, match=rf"port {port} is taken.*--port {port + 1}") as caught:
            listen("127.0.0.1", port)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("port", [-1, 65536])
def test_what_is_no_port_is_a_usage_error(port: int) -> None:
    with pytest.raises(UsageError, match=f"port {port}"):
        listen("127.0.0.1", port)


def test_a_connection_sends_at_once_what_it_has() -> None:
    with listen("127.0.0.1", 0) as listener, socket.create_connection(listener.getsockname()):
        accepted, _ = listener.accept()
        with accepted:
            assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY) != 0


def test_the_link_is_printed_as_jupyter_does(capsys: pytest.CaptureFixture[str]) -> None:
    print_link("http://127.0.0.1:8080/?token=abc")
    print_link("http://127.0.0.1:8080/?token=def", "operator 1")
    first, second = capsys.readouterr().out.splitlines()
    assert first.endswith("http://127.0.0.1:8080/?token=abc")
    assert second.startswith("operator 1 signed in")
    assert second.endswith("?token=def")


def test_the_slow_libraries_are_not_imported() -> None:
    code = (
        "import web.process, sys; "
        "print([m for m in ('numba', 'scipy', 'cv2', 'IPython') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.strip() == "[]"


def test_the_page_loads_nothing_from_elsewhere() -> None:
    folders = STATIC, *ROOT.glob("extensions/*/page")
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    assert len(files) > 100
    for path in files:
        text = path.read_text().replace("http://www.w3.org/2000/svg", "")
        assert "//cdn" not in text
        assert "https://" not in text.replace('"https:"', ""), path.name


def test_the_pages_behaviors_are_the_vehicles() -> None:
    kinds = {kind.name.name.lower(): kind for kind in machine.BEHAVIORS.values()}
    for behavior in described():
        arguments = kinds[behavior["name"]].arguments
        assert arguments is ARGUMENTS.get(behavior["name"], NoArguments)
        store = ParameterStore(arguments())
        for name, value in behavior.get("fixed", {}).items():
            store.check(name, value)
        for argument in behavior["arguments"]:
            assert argument["maximum"] == store.description(argument["name"]).maximum
            if argument["default"] != "":
                store.check(argument["name"], argument["default"])


def test_the_flight_volume_is_found_among_the_behavior_parameters() -> None:
    from control.behaviors.parameters import BehaviorParameters, flight_volume
    from quadrotor.parameters import Parameters

    class Root(Parameters):
        behavior: BehaviorParameters = BehaviorParameters()

    values = ParameterStore(Root()).values()
    box = flight_volume(lambda name: values.get(name))
    assert box is not None
    assert all(low < high and math.isfinite(low + high) for low, high in box)
    assert flight_volume(lambda _: None) is None


def test_the_process_serves_without_a_station_and_ends_in_order(tmp_path: Path) -> None:
    words = ["web", "--data", str(tmp_path), "--port", "0", "--loopback-port", "9"]
    process = subprocess.Popen(
        [sys.executable, "-m", "quadlab", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        assert said.startswith("quadlab is at  http://127.0.0.1:")
        url = said.split()[-1]
        assert re.search(r"/\?token=[\w-]+$", url)
        with httpx.Client() as client:
            base, _, token = url.partition("/?token=")
            client.post(f"{base}/login", data={"token": token})
            summary = client.get(f"{base}/api/summary").json()
            assert summary["status"] is None
            assert set(summary["age"].values()) == {None}
            answer = client.post(f"{base}/api/commands/arm", json={})
            assert answer.status_code == 503
        process.terminate()
        out, err = process.communicate(timeout=20.0)
    finally:
        process.kill()
    assert "admin 1 signed in" in out
    assert err == ""
    assert process.returncode == 0
