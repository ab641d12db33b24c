"""A page on this machine alone, and word of its changes to the browsers that show it."""

from __future__ import annotations

import json
import os
import secrets
import sys
import threading
from contextlib import contextmanager
from html import escape
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import TYPE_CHECKING, Any

from kincompile.report.templates import fill, read

if TYPE_CHECKING:
    from collections.abc import Iterator

HOST, PORT = "127.0.0.1", 8765
"""Where a page is served; another port where this one is taken."""

HEARTBEAT = 10.0
"""Seconds after which a browser that has gone away is noticed."""


class LivePage:
    """The last good page, and the error that has come since."""

    def __init__(self, title: str) -> None:
        self._changed = threading.Condition()
        self._title = title
        self._html = ""
        self._error = ""
        self._version = secrets.token_hex(8)
        self._has_ended = False

    def end(self) -> None:
        """Let go of those that wait for a change."""
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()

    def show(self, html: str) -> None:
        """Show a new page; there is no error now."""
        with self._changed:
            self._html, self._error, self._version = html, "", secrets.token_hex(8)
            self._changed.notify_all()

    def fail(self, error: str) -> None:
        """Show an error; the last good page stays."""
        with self._changed:
            self._error = error
            self._changed.notify_all()

    @property
    def html(self) -> str:
        """The page with the script that follows its changes."""
        with self._changed:
            script = f'<script data-version="{self._version}">\n{read("view/watch.js")}</script>\n'
            if not self._html:
                slots = {"title": escape(self._title), "style": read("view/style.css")}
                return fill("view/watch.html.jinja", slots | {"script": script})
            head, end, tail = self._html.rpartition("</body>")
            return f"{head}{script}{end}{tail}"

    def state(self) -> str:
        """Return the version of the page and its error, as JSON on one line."""
        return json.dumps({"version": self._version, "error": self._error})

    def state_after(self, last: str) -> str:
        """Return the state when it differs from the last, or after a while; "" at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._has_ended or self.state() != last, HEARTBEAT)
            return "" if self._has_ended else self.state()


class _Handler(BaseHTTPRequestHandler):
    """Answers with the page and with its changes; there is nothing else."""

    server: _Server
    server_version, sys_version = "kincompile", ""

    def do_GET(self) -> None:
        """Answer a request."""
        # A name of another site that points here (DNS rebinding) is not this server's.
        if self.headers.get_all("Host") not in self.server.names:
            self.send_error(HTTPStatus.FORBIDDEN, "This page is for this machine alone")
        elif self.path == "/":
            self._answer("text/html; charset=utf-8", self.server.page.html.encode())
        elif self.path == "/events":
            self._tell_changes()
        else:
            self.send_error(HTTPStatus.NOT_FOUND, "There is one page here: /")

    def _answer(self, kind: str, content: bytes | None) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", kind)
        if content is not None:
            self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content or b"")

    def end_headers(self) -> None:
        """End the headers with those that keep the page to itself."""
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Content-Security-Policy", "frame-ancestors 'none'")
        self.send_header("Cross-Origin-Resource-Policy", "same-origin")
        super().end_headers()

    def _tell_changes(self) -> None:
        """Send the state whenever it changes, until the browser goes away."""
        self._answer("text/event-stream", None)
        last = ""
        while state := self.server.page.state_after(last):
            self.wfile.write((f"data: {state}\n\n" if state != last else ":\n\n").encode())
            last = state

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        """Say nothing about requests."""


class _Server(ThreadingHTTPServer):
    """Serves one page."""

    daemon_threads = True
    # Elsewhere than on POSIX this would take the port of another server.
    allow_reuse_address = os.name == "posix"

    def __init__(self, port: int, page: LivePage) -> None:
        super().__init__((HOST, port), _Handler)
        self.page = page
        self.names = [[f"{name}:{self.server_port}"] for name in (HOST, "localhost")]

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Pass over a browser that has gone away."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


@contextmanager
def served(page: LivePage) -> Iterator[str]:
    """Serve a page while the `with` statement lasts; its value is the address."""
    try:
        server = _Server(PORT, page)
    except OSError:  # the port is taken
        server = _Server(0, page)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://{HOST}:{server.server_port}/"
    finally:
        page.end()
        server.shutdown()
        server.server_close()
