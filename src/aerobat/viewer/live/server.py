"""The server of a live page: it serves the page, and answers its questions, to this machine alone."""

from __future__ import annotations

import json
import socket
import threading
import time
import traceback
from collections.abc import Mapping
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import inf, isfinite
from typing import Any
from urllib.parse import urlsplit

from aerobat.errors import SpecError
from aerobat.viewer.live.replan import Answer, Desk

HOST = "127.0.0.1"
MAX_CONNECTIONS = 64  # each has a thread; half of the open files that the smallest shells allow
MAX_WAITING = 1024  # further connections, which the system queues
GRACE = 0.1  # [s] for the first line of a question, and for the rest, while other connections wait
PATIENCE = 10.0  # [s] for both while no other connection waits, and for receiving the answer
MAX_QUESTION = 100_000  # bytes: a few numbers for each gate
MAX_NAME = 100  # letters of the name that a page gives itself
JSON = "application/json"
HTML = "text/html; charset=utf-8"
BROKEN = Answer("Broken", "Aerobat failed at this, which is its fault; the terminal says where.", False)


class LiveServer(ThreadingHTTPServer):
    """Serves one page, and passes its questions to a desk.

    A connection serves one request. Idle connections are closed after PATIENCE, and after GRACE where other
    connections wait.
    """

    daemon_threads = True
    request_queue_size = MAX_WAITING

    def __init__(self, port: int, page: str, desk: Desk) -> None:
        self.page = page.encode()
        self.desk = desk
        self._kept_until: dict[socket.socket, float] = {}  # [s] of the clock, where others want the place
        self._changed = threading.Condition()
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise SpecError(f"port {port} cannot be served: {reason}; name another, or none") from None

    @property
    def hosts(self) -> tuple[str, ...]:
        """The values of the Host header that requests from this machine may have."""
        return tuple(f"{name}:{self.server_port}" for name in (HOST, "localhost"))

    def get_request(self) -> tuple[socket.socket, Any]:
        """Accept a connection. Wait a moment after a failure, as when the process has too many open files."""
        try:
            return super().get_request()
        except OSError:
            time.sleep(GRACE)
            raise

    def process_request(self, request: Any, client_address: Any) -> None:
        """Handle a connection in its own thread, once fewer than MAX_CONNECTIONS are open."""
        with self._changed:
            while len(self._kept_until) >= MAX_CONNECTIONS:
                self._close_silent(0.0)
                self._changed.wait(GRACE / 4)
            self._kept_until[request] = inf
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """Close a connection, and admit the next one."""
        super().shutdown_request(request)
        with self._changed:
            self._kept_until.pop(request, None)
            self._changed.notify()

    def service_actions(self) -> None:
        """Close connections that have been idle for too long; the server's loop calls this regularly."""
        with self._changed:
            self._close_silent(PATIENCE)

    def keep(self, request: socket.socket, duration: float) -> None:
        """Keep a connection open for this duration [s], even if other connections wait."""
        with self._changed:
            self._kept_until[request] = time.monotonic() + duration

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print nothing about a page that closed the connection before its answer came."""

    def _close_silent(self, patience: float) -> None:
        """Shut down connections whose time ended more than `patience` [s] ago, which ends their threads."""
        now = time.monotonic()
        for request, until in list(self._kept_until.items()):
            if now > until + patience:
                del self._kept_until[request]
                with suppress(OSError):
                    request.shutdown(socket.SHUT_RDWR)


class _Handler(BaseHTTPRequestHandler):
    """One connection of a page."""

    server: LiveServer
    timeout = PATIENCE

    def setup(self) -> None:
        super().setup()
        self.server.keep(self.connection, GRACE)

    def parse_request(self) -> bool:
        self.server.keep(self.connection, GRACE)
        return super().parse_request()

    def do_GET(self) -> None:
        self.server.keep(self.connection, inf)
        if not self._is_own_host():
            return
        if urlsplit(self.path).path == "/":
            self._send(HTTPStatus.OK, HTML, self.server.page)
        else:  # the icon that browsers ask for
            self._send(HTTPStatus.NO_CONTENT, HTML)

    def do_POST(self) -> None:
        """Answer the positions of the sliders with a verdict and a scene."""
        if not self._is_own_host():
            return
        size = self.headers.get("Content-Length", "")
        if not (size.isascii() and size.isdigit()):
            self._refuse(HTTPStatus.LENGTH_REQUIRED)
            return
        if len(size) > len(str(MAX_QUESTION)) or int(size) > MAX_QUESTION:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
            return
        content = self.rfile.read(int(size))
        self.server.keep(self.connection, inf)
        try:
            # a page of another place cannot send this type without asking, which is not answered
            if self.headers.get_content_type() != JSON:
                raise ValueError("not JSON")
            page, number, values = _question(json.loads(content))
        except (ValueError, OverflowError, RecursionError):
            self._send(HTTPStatus.BAD_REQUEST, JSON)
            return
        answer = self._answer(page, number, values)
        record = {"verdict": None} if answer is None else answer.record()
        self._send(HTTPStatus.OK, JSON, json.dumps(record, allow_nan=False).encode())

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing about requests."""

    def _answer(self, page: str, number: int, values: Mapping[str, float]) -> Answer | None:
        try:
            return self.server.desk.ask(page, number, values, self._has_hung_up)
        except Exception:
            traceback.print_exc()
            return BROKEN

    def _has_hung_up(self) -> bool:
        """Return True once the page has closed the connection."""
        try:
            self.connection.setblocking(False)
            return not self.connection.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:
            return True
        finally:
            with suppress(OSError):
                self.connection.settimeout(PATIENCE)

    def _is_own_host(self) -> bool:
        """Return True if the request names this machine as its host; otherwise refuse the request."""
        if self.headers.get("Host") in self.server.hosts:
            return True
        self._refuse(HTTPStatus.FORBIDDEN)
        return False

    def _refuse(self, status: HTTPStatus) -> None:
        """Refuse a request, and discard its body: unread data would cut off the answer."""
        self._send(status, JSON)
        self.connection.shutdown(socket.SHUT_WR)
        while self.rfile.read1(MAX_QUESTION):
            pass

    def _send(self, status: HTTPStatus, kind: str, content: bytes = b"") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)


def _question(content: Any) -> tuple[str, int, Mapping[str, float]]:
    """A page, the number of its question, and its sliders' values. Raises ValueError for anything else."""
    match content:
        case {"page": str(page), "number": int(number), "values": dict(values)} if len(page) <= MAX_NAME:
            numbers = {str(key): float(value) for key, value in values.items() if _is_number(value)}
            if len(numbers) == len(values):
                return page, number, numbers
    raise ValueError("no question")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
