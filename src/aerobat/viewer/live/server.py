"""The server of a live page: to this machine alone, the page and the answers to its sliders."""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import isfinite
from typing import Any
from urllib.parse import urlsplit

from aerobat.errors import SpecError
from aerobat.viewer.live.desk import Desk
from aerobat.viewer.live.replan import Answer, Verdict

HOST = "127.0.0.1"
MAX_QUESTION = 100_000  # bytes: a few numbers for each gate
JSON = "application/json"
HTML = "text/html; charset=utf-8"
BROKEN = Verdict("Broken", "Aerobat failed at this, which is its fault; the terminal says where.", False)


class LiveServer(ThreadingHTTPServer):
    """Serves one page, and hands its questions to a desk."""

    daemon_threads = True

    def __init__(self, port: int, page: str, desk: Desk) -> None:
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise SpecError(f"port {port} cannot be served: {reason}; name another, or none") from None
        self.page = page.encode()
        self.desk = desk

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names by which a browser on this machine may call it."""
        return tuple(f"{name}:{self.server_port}" for name in (HOST, "localhost"))

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that was closed, or went on to another question, before its answer came."""


class _Handler(BaseHTTPRequestHandler):
    """One connection of a page."""

    server: LiveServer
    protocol_version = "HTTP/1.1"  # a connection that stays takes several questions

    def do_GET(self) -> None:
        if not self._is_own_host():
            return
        if urlsplit(self.path).path == "/":
            self._send(HTTPStatus.OK, HTML, self.server.page)
        else:  # the icon that browsers ask for
            self._send(HTTPStatus.NO_CONTENT, HTML)

    def do_POST(self) -> None:
        """Answer where sliders stand, with what comes of it."""
        if not self._is_own_host():
            return
        size = self.headers.get("Content-Length", "")
        if not size.isdecimal() or int(size) > MAX_QUESTION:
            self.close_connection = True
            self._send(HTTPStatus.LENGTH_REQUIRED, JSON)
            return
        content = self.rfile.read(int(size))
        try:
            # a page of another place cannot send this type without asking, which is not answered
            if self.headers.get_content_type() != JSON:
                raise ValueError("not JSON")
            question = _question(json.loads(content))
        except ValueError:
            self._send(HTTPStatus.BAD_REQUEST, JSON)
            return
        answer = self._answer(question)
        record = {"verdict": None} if answer is None else answer.record()
        self._send(HTTPStatus.OK, JSON, json.dumps(record, allow_nan=False).encode())

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing of each request."""

    def _answer(self, question: _Question) -> Answer | None:
        try:
            return self.server.desk.ask(question.page, question.number, question.values)
        except Exception:
            traceback.print_exc()
            return Answer(BROKEN)

    def _is_own_host(self) -> bool:
        """True where the browser means this machine, whatever name some page gave it; else it is told no."""
        if self.headers.get("Host") in self.server.hosts:
            return True
        self.close_connection = True
        self._send(HTTPStatus.FORBIDDEN, HTML)
        return False

    def _send(self, status: HTTPStatus, kind: str, content: bytes = b"") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)


@dataclass(frozen=True)
class _Question:
    """Where the sliders of a page stand."""

    page: str
    number: int
    values: Mapping[str, float]


def _question(content: Any) -> _Question:
    """The question that a page sends. Raises ValueError for anything else."""
    match content:
        case {"page": str(page), "number": int(number), "values": dict(values)}:
            numbers = {str(key): float(value) for key, value in values.items() if _is_number(value)}
            if len(numbers) == len(values):
                return _Question(page, number, numbers)
    raise ValueError("no question")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
