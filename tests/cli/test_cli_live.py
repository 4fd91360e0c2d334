"""`aerobat view --live`: served until Ctrl-C, which is no failure, and what is refused before."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from aerobat import cli
from aerobat.viewer.live.view_live import LiveView
from shared_plans import shared_plan


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The command as a process of its own, and the address that it says."""
    shared_plan("line").save(tmp_path / "line.plan")
    command = [sys.executable, "-m", "aerobat", "view", "--live", "line.plan", "--no-browser", "--json"]
    process = subprocess.Popen(
        command, cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    said = "".join(process.stdout.readline() for _ in range(3))
    yield process, json.loads(said)["address"]
    process.kill()
    process.communicate()
    assert [path.name for path in tmp_path.iterdir()] == ["line.plan"], "nothing is written"


def ask(address: str, number: int, values: dict[str, float]) -> dict[str, dict[str, object]]:
    body = json.dumps({"page": "a", "number": number, "values": values}).encode()
    question = urllib.request.Request(f"{address}plan", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(question) as answer:
        return json.load(answer)


def test_it_serves_until_an_interrupt_which_is_no_failure(tmp_path: Path, monkeypatch, capsys) -> None:
    shared_plan("line").save(tmp_path / "line.plan")
    read: list[tuple[str, bytes]] = []

    def read_and_interrupt(view: LiveView) -> None:
        with urllib.request.urlopen(view.address) as page:
            read.append((view.address, page.read()))
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(LiveView, "wait", read_and_interrupt)
    cli.main(["view", "--live", str(tmp_path / "line.plan"), "--no-browser", "--json"])
    ((address, page),) = read
    assert json.loads(capsys.readouterr().out) == {"address": address}
    assert b"line \xc2\xb7 agile-quad" in page
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address)


@pytest.mark.process
def test_it_answers_until_an_interrupt_which_ends_it_well(served) -> None:
    process, address = served
    assert address.startswith("http://127.0.0.1:")
    with urllib.request.urlopen(address) as page:
        assert b"line \xc2\xb7 agile-quad" in page.read()
    first = ask(address, 1, {})["verdict"]
    assert first["is_well"], first
    assert ask(address, 2, {"vehicle.thrust_to_weight": 2.0})["verdict"]["sentence"] != first["sentence"]
    process.send_signal(signal.SIGINT)
    assert process.communicate() == ("", "")
    assert process.returncode == 0


@pytest.mark.process
def test_an_interrupt_while_something_is_planned_ends_it_too(served) -> None:
    process, address = served
    assert ask(address, 1, {})["verdict"]["is_well"]

    def asking() -> None:
        with suppress(OSError):
            ask(address, 2, {"vehicle.thrust_to_weight": 1.5})

    asked = threading.Thread(target=asking)
    asked.start()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate()
    asked.join()
    assert (process.returncode, said) == (0, "")


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="limits and lists of open files are of Linux")
def test_200_clients_are_answered_beside_500_silent_connections_by_a_process_of_128_files(served) -> None:
    import resource

    process, address = served
    resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (128, 128))
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    well: list[object] = []

    def asking(k: int) -> None:
        body = json.dumps({"page": f"page {k}", "number": 1, "values": {}}).encode()
        question = urllib.request.Request(f"{address}plan", body, {"Content-Type": "application/json"})
        with urllib.request.urlopen(question, timeout=20.0) as answer:
            well.append(json.load(answer)["verdict"]["is_well"])

    with ExitStack() as stack:
        for k in range(500):
            silent = stack.enter_context(socket.create_connection((host, int(port))))
            silent.sendall((b"", b"POST /pl", b"GET / HTTP/1.1\r\nHost")[k % 3])
        clients = [threading.Thread(target=asking, args=(k,)) for k in range(200)]
        for client in clients:
            client.start()
        for client in clients:
            client.join()
    assert well == [True] * 200
    assert len(list(Path(f"/proc/{process.pid}/fd").iterdir())) < 128


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--live", "nowhere"], "no problem named 'nowhere'"),
        (["--live", "line", "--html", "page.html"], "--html is for a page that is written"),
        (["--live", "line", "--conditions", "loft"], "no conditions named 'loft'"),
        (["--live", "line", "--planner", "mine"], "mine"),
        (["--port", "8000", "kept"], "--port is for --live"),
        (["--no-browser", "kept"], "--no-browser is for --live"),
        ([], "give --live"),
    ],
)
def test_what_cannot_be_served_is_refused_in_a_sentence(arguments: list[str], sentence: str, capsys) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["view", *arguments])
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert not out
    assert sentence in err
    assert err.count("\n") == 1
