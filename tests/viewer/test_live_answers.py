"""Answers of live pages: which plan, in which words, and of many questions the last."""

from __future__ import annotations

import errno
import http.client
import json
import os
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing
from dataclasses import replace

import pytest

import aerobat as ab
from aerobat.viewer.live.replan import FLIGHTS, MAX_PAGES, Answer, Desk, Replanner, Superseded
from aerobat.viewer.live.server import GRACE
from aerobat.viewer.live.sliders import Setting, sliders_of
from aerobat.viewer.live.view_live import LiveView
from shared_plans import shared_plan

JSON = {"Content-Type": "application/json"}
FINE = Answer("Feasible", "fine", True)


@pytest.fixture(scope="module")
def replanner() -> Replanner:
    """The half-flip's."""
    plan = shared_plan("half-flip")
    assert plan.vehicle is not None
    begun = Setting(plan.problem, ab.Miqp(), plan.vehicle, ab.Dispersion(mass=0.2))
    return Replanner(begun, sliders_of(begun, plan))


@pytest.fixture(scope="module")
def live() -> Iterator[LiveView]:
    with ab.view_live(shared_plan("line"), browser=False) as view:
        yield view


def never() -> bool:
    return False


def ask(
    live: LiveView, body: object, path: str = "/plan", headers: Mapping[str, str] = JSON
) -> tuple[int, bytes]:
    """Status and content of an answer."""
    with closing(http.client.HTTPConnection(live.address.removeprefix("http://").strip("/"))) as connection:
        content = body if isinstance(body, bytes) else json.dumps(body).encode()
        connection.request("POST", path, content, dict(headers))
        answer = connection.getresponse()
        return answer.status, answer.read()


@pytest.mark.slow
def test_a_plan_for_where_the_sliders_stand_is_the_plan_of_that_problem(replanner: Replanner) -> None:
    answer = replanner.answer({"gates[0].position.z": 4.0}, never)
    again = ab.plan(moved_gate(4.0), ab.Miqp(), "agile-quad")
    assert answer.scene is not None
    assert answer.scene.times[-1] == pytest.approx(again.duration)
    assert answer.scene.gates[0].position[2] == 4.0
    assert again.certificate is not None
    assert answer.word == ("Feasible" if again.certified else "Not proven")
    assert answer.sentence == f"{again.duration:.2f} s, {again.certificate.why}"
    assert answer.is_well == again.certified


def moved_gate(height: float) -> ab.Problem:
    problem = ab.load_problem("half-flip")
    return replace(problem, gates=(replace(problem.gates[0], position=(2.5, 2.0, height)),))


@pytest.mark.parametrize(
    ("values", "word", "sentence"),
    [
        ({"maneuver.min_lateral_thrust": 38.0}, "Infeasible", "agile-quad gives 32"),
        ({"gates[0].tilt": 120.0}, "Refused", "must be from -90 to 90 for a half-flip"),
    ],
)
def test_what_cannot_be_is_said_in_a_sentence(
    replanner: Replanner, values: dict[str, float], word: str, sentence: str
) -> None:
    answer = replanner.answer(values, never)
    assert answer.word == word
    assert sentence in answer.sentence
    assert not answer.is_well
    assert answer.scene is None


def test_dispersed_flights_are_of_the_same_plan_and_counted(replanner: Replanner) -> None:
    one = replanner.answer({}, never).scene
    plans = len(replanner.plans)
    many = replanner.answer({"dispersion": 2.0}, never)
    assert len(replanner.plans) == plans, "nothing was planned anew"
    assert one is not None
    assert many.scene is not None
    assert len(many.scene.tracks) == FLIGHTS
    failed = sum(track.failed for track in many.scene.tracks)
    assert many.word == f"{failed} of {FLIGHTS} flights fail"
    assert (many.scene.planned[-1] == one.planned[-1]).all()


def test_planning_that_is_superseded_is_given_up(replanner: Replanner) -> None:
    plans = len(replanner.plans)
    with pytest.raises(Superseded):
        replanner.answer({"gates[0].position.z": 2.7}, lambda: True)
    assert len(replanner.plans) == plans


def test_the_last_question_of_each_page_is_answered_in_whichever_order_they_come() -> None:
    """Requests of a browser are sent in one order and heard in another."""
    begun, go_on, pause = threading.Event(), threading.Event(), threading.Event()
    seen: list[tuple[str, float]] = []

    def answering(values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer:
        begun.set()
        go_on.wait()
        if is_superseded():
            raise Superseded
        seen.append((values["page"], values["number"]))
        return FINE

    desk = Desk(answering)
    answers: dict[tuple[str, int], Answer | None] = {}

    def put(page: str, number: int) -> threading.Thread:
        def asking() -> None:
            values = {"page": ord(page), "number": number}
            answers[page, number] = desk.ask(page, number, values, never)

        asked = threading.Thread(target=asking)
        asked.start()
        while desk._last.get(page, 0) < number:  # until it is heard
            pause.wait(0.001)
        return asked

    threads = [put("a", 1)]
    begun.wait()
    threads += [put("b", 1), put("a", 4), put("a", 3)]
    go_on.set()
    for thread in threads:
        thread.join()
    assert answers == {("a", 1): None, ("b", 1): FINE, ("a", 3): None, ("a", 4): FINE}
    assert seen == [(ord("b"), 1), (ord("a"), 4)]
    desk.close()
    assert desk.ask("a", 5, {}, never) is None


def test_a_question_that_nobody_waits_for_is_not_answered_and_pages_are_forgotten() -> None:
    desk = Desk(lambda values, is_superseded: FINE)
    assert desk.ask("gone", 1, {}, lambda: True) is None
    for k in range(MAX_PAGES + 10):
        assert desk.ask(f"page {k}", 1, {}, never) == FINE
    assert len(desk._last) == MAX_PAGES
    desk.close()


def test_the_page_is_served_to_this_machine_alone_and_to_pages_of_no_other_place(live: LiveView) -> None:
    host, port = live._server.server_address[:2]
    assert host == "127.0.0.1"
    question = {"page": "a", "number": 1, "values": {}}
    assert ask(live, question)[0] == 200
    assert ask(live, question, headers={**JSON, "Host": f"example.org:{port}"})[0] == 403
    assert ask(live, question, headers={"Content-Type": "text/plain"})[0] == 400
    for body in (
        b"",
        b"[",
        [],
        {},
        {"page": "a", "number": 1},
        {"page": "a", "values": {}},
        {"page": 1, "number": 1, "values": {}},
        {"page": "a", "number": 1, "values": {"x": True}},
    ):
        assert ask(live, body)[0] == 400
    assert ask(live, b'{"page": "a", "number": 1, "values": {"x": NaN}}')[0] == 400
    for content in (b"[" * 50_000, b'{"page": "a", "number": 1, "values": {"x": 1%s}}' % (b"0" * 400)):
        assert ask(live, content)[0] == 400
    assert ask(live, {"page": "a" * 1000, "number": 1, "values": {}})[0] == 400
    for size, status in (("9" * 9, 413), ("9" * 5000, 413), ("-1", 411), ("", 411)):
        assert ask(live, b"", headers={**JSON, "Content-Length": size})[0] == status
    assert ask(live, bytes(500_000))[0] == 413, "the answer is heard before the connection is closed"


def test_who_hangs_up_while_something_is_planned_is_planned_for_no_more(live: LiveView, monkeypatch) -> None:
    begun, ended, pause = threading.Event(), threading.Event(), threading.Event()

    def answering(values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer:
        begun.set()
        while not is_superseded():
            pause.wait(0.001)
        ended.set()
        raise Superseded

    monkeypatch.setattr(live._server.desk, "_answering", answering)
    content = b'{"page": "gone", "number": 1, "values": {}}'
    with socket.create_connection(live._server.server_address) as client:
        head = f"POST /plan HTTP/1.1\r\nHost: {live.address[7:-1]}\r\nContent-Type: application/json\r\n"
        client.sendall(f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content)
        assert begun.wait(10.0)
        assert not ended.wait(0.05), "it still waits"
    assert ended.wait(10.0)


def test_many_clients_are_answered_beside_many_connections_that_say_nothing(live: LiveView) -> None:
    """As of a browser's connections that are opened ahead, and of programs that hang."""
    address = live._server.server_address
    with ExitStack() as stack:
        for k in range(200):
            silent = stack.enter_context(socket.create_connection(address))
            silent.sendall(b"POST /plan" if k % 2 else b"")
        found: list[int] = []
        clients = [
            threading.Thread(target=lambda k=k: found.append(ask(live, {"page": f"{k}"})[0]))
            for k in range(50)
        ]
        for client in clients:
            client.start()
        for client in clients:
            client.join(10.0)
    assert found == [400] * 50


def test_a_connection_that_says_nothing_is_closed_after_a_while(live: LiveView, monkeypatch) -> None:
    monkeypatch.setattr("aerobat.viewer.live.server.PATIENCE", 0.05)
    with socket.create_connection(live._server.server_address, timeout=10.0) as silent:
        assert silent.recv(1) == b""


def test_a_process_with_too_many_open_files_tries_again_after_a_pause(live: LiveView, monkeypatch) -> None:
    def accept(server: object) -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    pauses: list[float] = []
    monkeypatch.setattr("socketserver.TCPServer.get_request", accept)
    monkeypatch.setattr("aerobat.viewer.live.server.time.sleep", pauses.append)
    with pytest.raises(OSError, match="Too many open files"):
        live._server.get_request()
    assert pauses == [GRACE]


def test_a_failure_of_our_own_is_told_and_the_page_lives_on(live: LiveView, monkeypatch, capsys) -> None:
    def fail(*question: object) -> None:
        raise ZeroDivisionError("planted")

    with monkeypatch.context() as planted:
        planted.setattr(live._server.desk, "ask", fail)
        status, content = ask(live, {"page": "a", "number": 1, "values": {}})
    assert status == 200
    assert json.loads(content)["verdict"]["word"] == "Broken"
    assert "planted" in capsys.readouterr().err
    assert json.loads(ask(live, {"page": "a", "number": 1, "values": {}})[1])["verdict"]["is_well"]


def test_a_port_that_is_taken_is_named(live: LiveView) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ab.SpecError, match=f"port {port} cannot be served"):
            ab.view_live(shared_plan("line"), port=port, browser=False)


def test_a_plan_is_begun_with_as_it_is_and_an_infeasible_problem_with_its_sentence() -> None:
    with pytest.raises(ab.Infeasible, match="agile-quad gives"):
        ab.view_live(demanding(ab.load_problem("half-flip")), browser=False)
    with ab.view_live(shared_plan("line"), browser=False) as view:
        assert view._repr_html_().count(view.address) == 1
        assert repr(view) == f"LiveView({view.address})"
    with pytest.raises(ConnectionRefusedError, match="refused"):
        ask(view, {"page": "a", "number": 1, "values": {}})


def demanding(problem: ab.Problem) -> ab.Problem:
    """Asks for more thrust than agile-quad has."""
    return replace(problem, maneuver=ab.HalfFlip(min_lateral_thrust=50.0))
