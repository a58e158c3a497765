"""Campaigns on real schedulers and workers of Dask, on this computer."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.tests.conftest import COMPILED, rows
from extensions.campaigns.tests.dask_processes import SCHEDULER, dask, worker
from extensions.campaigns.tests.disturbed import rows_of, started, until
from quadrotor.checkout import PACKAGES, ROOT

GAINS = COMPILED + '[factors]\n"control.position.kp_xy" = [3.0, 4.0, 5.0]\n'


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """Yield the address of a scheduler without workers."""
    deaths = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}  # not 3, which takes longer
    with dask(*SCHEDULER, until="Scheduler at:", environment=deaths) as (_, line):
        found = re.search(r"tcp://\S+", line)
        assert found is not None
        yield found[0]


def test_rows_by_dask_are_those_of_one_process_whatever_dies(
    bench: Any, scheduler: str, tmp_path: Path
) -> None:
    plan = bench.plan(GAINS)
    alone = bench.flown(GAINS, "alone")
    cases = (
        'experiment = "cases.py"\n[fixed]\n'
        f'"experiment.folder" = "{tmp_path}"\n'
        '[factors]\n"experiment.case" = ["raises", "dies", "dies once", "good"]\n'
    )
    with worker(scheduler), worker(scheduler):
        flown = bench.run(plan, "dask", "--dask", scheduler)
        assert rows(flown).equals(rows(alone))
        table = bench.run(bench.plan(cases), "hard", "--dask", scheduler).table()
    assert table["verdict"].to_pylist() == ["raised", "worker_died", "passed", "passed"]
    assert table["reason"].to_pylist()[1] == "each worker that flew it died"


def test_a_run_whose_scheduler_is_killed_ends_in_one_line_and_is_resumed(
    bench: Any, scheduler: str
) -> None:
    text = 'experiment = "cases.py"\nseeds = 12\n'
    plan, out = bench.plan(text), bench.folder / "out"
    with dask(*SCHEDULER, until="Scheduler at:") as (process, line):
        address = re.search(r"tcp://\S+", line)
        assert address is not None
        with worker(address[0], "--no-nanny"):
            run = started("run", plan, "--out", out, "--dask", address[0])
            assert until(lambda: rows_of(out) >= 1, run)
            process.kill()
            _, said = run.communicate()
    assert run.returncode == 1
    assert said.strip().splitlines()[-1].startswith("quadlab: the scheduler of Dask has gone; ")
    assert "Traceback" not in said
    assert 1 <= rows_of(out) < 12
    with worker(scheduler, "--no-nanny"):
        assert bench.quadlab("resume", out, "--dask", scheduler)[0] == 0
    assert rows(CampaignFolder(out)).equals(rows(bench.flown(text, "alone")))


def test_a_worker_with_another_quadlab_is_refused_by_its_name(
    bench: Any, scheduler: str, tmp_path: Path
) -> None:
    out, other = bench.folder / "out", tmp_path / "other"
    for name in (*PACKAGES, "quadlab"):
        ignored = shutil.ignore_patterns("__pycache__", "tests", "static", "*.h5", "page")
        shutil.copytree(ROOT / name, other / name, ignore=ignored)
    with (other / "control" / "rate_law.py").open("a") as file:
        file.write("# changed\n")
    python = ("env", "-C", str(other), sys.executable)
    with worker(scheduler, "--no-nanny", python=python):
        line = bench.refused("run", bench.plan(GAINS), "--out", out, "--dask", scheduler)
    found = r"the worker tcp://127.0.0.1:\d+ \(.*\) has sources \w+, this computer has \w+; install"
    assert re.search(found, line)
    assert not out.exists(), "nothing was begun"


def test_a_worker_without_quadlab_is_refused_by_its_name(
    bench: Any, scheduler: str, tmp_path: Path
) -> None:
    import distributed

    bare = tmp_path / "bare"
    bare.mkdir()
    for one in Path(distributed.__file__).parents[1].iterdir():
        if "quadlab" not in one.name:
            (bare / one.name).symlink_to(one)
    python = ("env", "-C", str(bare), sys.executable, "-S")
    with worker(scheduler, "--no-nanny", python=python, environment={"PYTHONPATH": str(bare)}):
        out = bench.folder / "out"
        line = bench.refused("run", bench.plan(GAINS), "--out", out, "--dask", scheduler)
    assert re.search(r"the worker tcp://\S+ \(.*\) has no quadlab; install it there", line)


def test_without_a_scheduler_or_a_worker_one_line_says_so(
    bench: Any, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from extensions.campaigns.engines import dask_engine

    monkeypatch.setattr(dask_engine, "REACH", "2s")
    monkeypatch.setattr(dask_engine, "FIRST_WORKER", 1.0)
    plan, out = bench.plan(GAINS), bench.folder / "out"
    line = bench.refused("run", plan, "--out", out, "--dask", "tcp://127.0.0.1:9")
    assert "no scheduler of Dask answers at tcp://127.0.0.1:9" in line
    line = bench.refused("run", plan, "--out", out, "--dask", scheduler)
    assert f"the scheduler {scheduler} has no workers" in line
    assert "give one of both" in bench.refused(
        "run", plan, "--out", out, "--dask", scheduler, "--workers", 2
    )
    assert not out.exists(), "nothing was begun"


def tls_files(folder: Path) -> tuple[str, ...]:
    """Make the authority of a laboratory and a certificate of it; return the options of Dask."""
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec

    from vehicle_link.security.certificates import certificate_builder, pem_of_key, signed

    authority, own = (ec.generate_private_key(ec.SECP256R1()) for _ in range(2))
    constraints = x509.BasicConstraints(ca=True, path_length=None)
    root = certificate_builder("laboratory", "laboratory", authority)
    files = {
        "ca-file": signed(root.add_extension(constraints, critical=True), authority),
        "cert": signed(certificate_builder("host", "laboratory", own), authority),
        "key": pem_of_key(own),
    }
    words = []
    for name, content in files.items():
        place = folder / f"{name}.pem"
        place.write_bytes(content)
        words += [f"--tls-{name}", str(place)]
    return tuple(words)


def test_scheduler_worker_and_run_speak_tls(bench: Any, tmp_path: Path) -> None:
    files = tls_files(tmp_path)
    ca_file, certificate, key = files[1::2]
    place = ("scheduler", "--host", "tls://127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
    plan, out = bench.plan(COMPILED), bench.folder / "out"
    with dask(*place, *files, until="Scheduler at:") as (_, line):
        address = re.search(r"tls://\S+", line)
        assert address is not None
        with worker(address[0], "--no-nanny", *files):
            known = {"CA_FILE": ca_file, "CLIENT__CERT": certificate, "CLIENT__KEY": key}
            environment = {f"DASK_DISTRIBUTED__COMM__TLS__{k}": v for k, v in known.items()}
            run = started("run", plan, "--out", out, "--dask", address[0], environment=environment)
            _, said = run.communicate()
            assert run.returncode == 0, said
    assert rows(CampaignFolder(out)).equals(rows(bench.flown(COMPILED, "alone")))


def test_an_address_with_tls_needs_certificates_that_can_be_read(bench: Any) -> None:
    from dask import config

    words = ("run", bench.plan(COMPILED), "--out", bench.folder / "out", "--dask", "tls://there:1")
    line = bench.refused(*words)
    assert "--dask tls://there:1 needs certificates: set DASK_DISTRIBUTED__COMM__TLS__CA_" in line
    names = ("ca-file", "client.cert", "client.key")
    none = {f"distributed.comm.tls.{name}": str(bench.folder / "none.pem") for name in names}
    with config.set(none):
        line = bench.refused(*words)
    assert "the certificates that Dask is configured with cannot be read (No such file" in line
    assert not (bench.folder / "out").exists(), "nothing was begun"
