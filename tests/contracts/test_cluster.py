"""A study on a Dask cluster ends with the bytes of one on a single process, or says in one line why it cannot."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

import snakebench
from snakebench import cluster

PLUGIN = Path(__file__).parents[2] / "examples" / "cpg.py"
STUDY = """
question = "Does it matter who evaluates a front?"
method = "pareto"
fluids = ["water", "oil2"]
profile = "tiny"
[profiles.tiny]
search = "grid"
engine = "pybullet"
grid = [4, 3, 3]
seeds = [0]
duration = 2.0
periods = 1
"""


@contextmanager
def running(*words: object, cwd: Path, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """A process while it is needed, and its log in `cwd`."""
    with (cwd / f"{words[0]}.log").open("a") as log:
        command = [sys.executable, "-m", "dask", *map(str, words)]
        process = subprocess.Popen(command, cwd=cwd, stdout=log, stderr=log, env=os.environ | environment)
        try:
            yield process
        finally:
            process.kill()
            process.wait()


@contextmanager
def scheduler_process(directory: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A scheduler on a free port, and its address."""
    directory.mkdir(exist_ok=True)
    file = directory / "scheduler.json"
    options = ("--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--no-show", "--scheduler-file", file)
    with running("scheduler", *options, cwd=directory) as process:
        while not (file.exists() and file.read_text().rstrip().endswith("}")):
            assert process.poll() is None
            time.sleep(0.05)
        yield process, json.loads(file.read_text())["address"]


@contextmanager
def worker(address: str, directory: Path, threads: int = 1, **environment: str) -> Iterator[subprocess.Popen[str]]:
    directory.mkdir(exist_ok=True)
    options = ("--nthreads", threads, "--no-nanny", "--no-dashboard", "--local-directory", directory)
    with running("worker", address, *options, cwd=directory, **environment) as process:
        yield process


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    with scheduler_process(tmp_path_factory.mktemp("scheduler")) as (_, address):
        yield address


def start(directory: Path, *options: str, study: str = STUDY) -> subprocess.Popen[str]:
    (directory / "tiny.toml").write_text(study)
    command = [sys.executable, "-m", "snakebench.cli", "run-study", "tiny.toml", *options]
    return subprocess.Popen(
        command, cwd=directory, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )


def on(address: str) -> tuple[str, ...]:
    return "--executor", "dask", "--scheduler", address


def finish(process: subprocess.Popen[str]) -> None:
    """Wait for a study; it says what it does and nothing else."""
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert all(line.startswith(("tiny: ", "compiling ")) for line in err.splitlines()), err


def refusal(process: subprocess.Popen[str]) -> str:
    """The one line by which a study ends."""
    out, err = process.communicate(timeout=300)
    last = err.splitlines()[-1]
    assert process.returncode == 2 and out == "" and "Traceback" not in err, err
    assert last.startswith("snakebench: ") and err.count("snakebench: ") == 1, err
    return last


def outcome(directory: Path) -> dict[str, bytes]:
    """Every table and trajectory by its path; the manifest, which tells the time and machine, is left out."""
    files = [path for path in (directory / "results" / "tiny").rglob("*") if path.is_file()]
    return {str(path.relative_to(directory)): path.read_bytes() for path in files if path.name != "manifest.json"}


def members(group: int) -> list[str]:
    """What still runs in a process group."""
    listed = subprocess.run(["ps", "-A", "-o", "pgid=,stat=,args="], capture_output=True, text=True, check=True).stdout
    rows = [line.split(maxsplit=2) for line in listed.splitlines()]
    return [row[2] for row in rows if int(row[0]) == group and not row[1].startswith("Z")]


@pytest.fixture(scope="module")
def alone(tmp_path_factory) -> dict[str, bytes]:
    """The outcome of the study in a single process."""
    directory = tmp_path_factory.mktemp("alone")
    finish(start(directory, "--workers", "1"))
    assert len(outcome(directory)) > 2
    return outcome(directory)


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_bytes_of_a_single_process(alone, scheduler, tmp_path, wait_for):
    with worker(scheduler, tmp_path / "one") as killed, worker(scheduler, tmp_path / "two"):
        process = start(tmp_path, *on(scheduler))
        wait_for(process, tmp_path, 10)
        killed.kill()
        finish(process)
    assert outcome(tmp_path) == alone


@pytest.mark.slow
def test_a_cluster_of_this_machine_gives_the_bytes_of_a_single_process(alone, tmp_path):
    finish(start(tmp_path, "--executor", "dask", "--workers", "2"))
    assert outcome(tmp_path) == alone
    assert json.loads((tmp_path / "results" / "tiny" / "manifest.json").read_text())["executor"] == "dask"


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["worker", "scheduler"])
def test_a_lost_cluster_is_one_line_and_what_was_evaluated_is_kept(lost, tmp_path, wait_for, evaluated):
    with scheduler_process(tmp_path / "cluster") as (its_scheduler, address), worker(address, tmp_path / "one") as one:
        process = start(tmp_path, *on(address))
        wait_for(process, tmp_path, 5)
        {"worker": one, "scheduler": its_scheduler}[lost].kill()
        assert "what was evaluated is kept, the same command continues" in refusal(process)
    assert evaluated(tmp_path) >= 5


@pytest.mark.slow
def test_an_interrupt_leaves_no_processes(tmp_path, wait_for):
    process = start(tmp_path, "--executor", "dask", "--workers", "2")
    wait_for(process, tmp_path, 5)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to the workers as well
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err and "same command continues" in err.splitlines()[-1]
    for _ in range(200):
        if not (left := members(process.pid)):
            break
        time.sleep(0.1)
    assert not left


@pytest.mark.slow  # test_evaluator.py refuses the same from a worker of this machine
def test_numbers_of_another_version_are_refused(scheduler, tmp_path, evaluated):
    package = tmp_path / "other" / "snakebench"
    shutil.copytree(Path(snakebench.__file__).parent, package)
    metrics = package / "metrics.py"
    code = metrics.read_text()
    assert "def speed(" in code
    metrics.write_text(
        code.replace("def speed(", "def old_speed(") + "\n\ndef speed(*_: object) -> float:\n    return 1.0\n"
    )
    with worker(scheduler, package.parent, PYTHONPATH=str(package.parent)):
        assert "another version of snakebench" in refusal(start(tmp_path, *on(scheduler)))
    assert evaluated(tmp_path) == 0


@pytest.mark.slow
@pytest.mark.parametrize("study", [STUDY, STUDY + 'gait = "cpg"\n'], ids=["metric", "gait"])
def test_a_worker_without_the_plug_in_is_refused_by_its_name(study, scheduler, tmp_path, evaluated, monkeypatch):
    with worker(scheduler, tmp_path / "one"):
        monkeypatch.setenv("SNAKEBENCH_PLUGINS", str(PLUGIN))
        process = start(tmp_path, *on(scheduler), study=study)
        assert f"a worker lacks the plug-in {PLUGIN}, or has another version of it" in refusal(process)
    assert evaluated(tmp_path) == 0


@pytest.mark.slow
def test_a_worker_with_a_plug_in_of_its_own_is_refused_by_its_name(scheduler, tmp_path):
    with worker(scheduler, tmp_path / "one", SNAKEBENCH_PLUGINS=str(PLUGIN)):
        assert f"a worker has a plug-in that is not here, {PLUGIN}" in refusal(start(tmp_path, *on(scheduler)))


@pytest.mark.slow
def test_a_worker_whose_plug_in_cannot_be_loaded_is_refused_by_its_name(scheduler, tmp_path):
    with worker(scheduler, tmp_path / "one", SNAKEBENCH_PLUGINS="gone.py"):
        assert "a worker cannot load the plug-in gone.py" in refusal(start(tmp_path, *on(scheduler)))


@pytest.mark.slow
def test_a_worker_loads_its_plug_in_before_a_gait_needs_it(scheduler, tmp_path, monkeypatch):
    copy = tmp_path / "there" / "cpg.py"  # wherever it is, its code counts
    copy.parent.mkdir()
    shutil.copy(PLUGIN, copy)
    with worker(scheduler, tmp_path / "one", SNAKEBENCH_PLUGINS=str(copy)):
        monkeypatch.setenv("SNAKEBENCH_PLUGINS", str(PLUGIN))
        finish(start(tmp_path, *on(scheduler), study=STUDY.replace("[4, 3, 3]", "[2, 2, 2]") + 'gait = "cpg"\n'))


def test_a_worker_of_several_threads_is_refused(scheduler, snakebench_command, tmp_path):
    (tmp_path / "tiny.toml").write_text(STUDY)
    with worker(scheduler, tmp_path / "one", threads=2):
        code, out, err = snakebench_command("run-study", "tiny.toml", *on(scheduler))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "has 2 threads" in err and f"dask worker {scheduler} --nthreads 1" in err


def test_a_scheduler_without_workers_is_refused(scheduler, snakebench_command, tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "_PATIENCE", 2.0)
    (tmp_path / "tiny.toml").write_text(STUDY)
    code, out, err = snakebench_command("run-study", "tiny.toml", *on(scheduler))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "no workers" in err and f"dask worker {scheduler} --nthreads 1" in err


@pytest.mark.parametrize(
    ("options", "complaints"),
    [
        (on("tcp://127.0.0.1:1"), ("scheduler = tcp://127.0.0.1:1: no answer", "start one by `dask scheduler`")),
        (on("somewhere"), ("scheduler = 'somewhere': an address such as tcp://HOST:8786",)),
        (on("tcp://127.0.0.1:port"), ("an address such as tcp://HOST:8786",)),
        (on("tls://127.0.0.1:1"), ("scheduler = tls://127.0.0.1:1: tls needs certificates", "distributed.comm.tls")),
        (on("http://127.0.0.1:8786"), ("an address such as tcp://HOST:8786",)),
        (("--scheduler", "tcp://127.0.0.1:1"), ("only --executor dask",)),
        ((*on("tcp://127.0.0.1:1"), "--workers", "2"), ("exclude each other",)),
        (("--executor", "dask", "--workers", "0"), ("workers = 0",)),
        (("--executor", "dusk"), ("did you mean dask",)),
    ],
)
def test_what_cannot_work_is_refused_before_anything_is_run(
    snakebench_command, tmp_path, monkeypatch, options, complaints
):
    monkeypatch.setattr(cluster, "_PATIENCE", 2.0)
    (tmp_path / "tiny.toml").write_text(STUDY)
    code, out, err = snakebench_command("run-study", "tiny.toml", *options)
    assert code == 2 and out == "" and err.count("\n") == 1
    assert all(complaint in err for complaint in complaints)
    assert not (tmp_path / "results").exists()


@pytest.fixture
def server():
    """A server on a free port that says something again and again, or nothing: its address."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve(says: bytes) -> str:
            threading.Thread(target=_say, args=(listening, says), daemon=True).start()
            return f"tcp://127.0.0.1:{listening.getsockname()[1]}"

        yield serve


def _say(listening: socket.socket, text: bytes) -> None:
    kept = []
    with suppress(OSError):
        while True:
            kept.append(listening.accept()[0])
            kept[-1].sendall(text)


@pytest.mark.parametrize(
    ("says", "complaint"),
    [
        (b"", "no answer within 2 s; start one by `dask scheduler`"),
        (b"SSH-2.0-OpenSSH_9.6\r\n" + 9 * b"\xff", "what answers there is no scheduler of Dask; start one"),
    ],
)
def test_a_port_that_is_no_scheduler_is_refused(server, snakebench_command, tmp_path, monkeypatch, says, complaint):
    monkeypatch.setattr(cluster, "_PATIENCE", 2.0)
    (tmp_path / "tiny.toml").write_text(STUDY)
    address = server(says)
    code, out, err = snakebench_command("run-study", "tiny.toml", *on(address))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"snakebench: scheduler = {address}: {complaint}")


def test_without_dask_the_line_says_how_to_get_it(tmp_path, monkeypatch):
    (tmp_path / "distributed.py").write_text("raise ModuleNotFoundError(name='distributed')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    line = refusal(start(tmp_path, "--executor", "dask"))
    assert 'needs Dask: in the clone, pip install -c constraints.txt ".[cluster]"' in line
