"""Where a scene goes: a page that this process serves, or a meshcat server that is running.

Meshcat's server cannot do what the page needs: it has one fixed page, listens on every address of the machine, and
answers no questions.
"""

from __future__ import annotations

import base64
import contextlib
import errno
import io
import ipaddress
import json
import socket
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler
from socketserver import ThreadingTCPServer
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import umsgpack
import zmq

from clamp3d.checks import text, whole
from clamp3d.errors import Clamp3dError, InputError

PORT, PORTS = 7000, 200
"""First port tried, meshcat's own, and how many are tried; unless the user named one."""
FRONT = 10
"""Render order of what is drawn over the solids; labels come after it."""
_TIMEOUT = 10.0  # s for an answer of a meshcat server, and for new commands of a page

Command = dict[str, Any]
Answer = Callable[[Mapping[str, str]], str | dict[str, Any]]


def server_at(url: str | None, host: str, port: int | None) -> PageServer | MeshcatServer:
    """The meshcat server at ``url``, where that is given, else one of our own. Raises InputError, Clamp3dError."""
    return PageServer(host, port) if url is None else MeshcatServer(url)


class CommandLog:
    """The commands that still matter, in order: a later one replaces an earlier one of the same kind at its place.

    The geometry of objects is a command of its own, which our page knows: it is kept once, however many have it. A
    meshcat `Visualizer` takes the log for its window; what it sends goes on to the ``server`` too, if there is one.

    >>> log = CommandLog()
    >>> for x in (1.0, 2.0):
    ...     log.add({"type": "set_property", "path": "/a", "property": "scale", "value": [x, x, x]})
    >>> len(log.messages()), len(log.messages(since=1)), len(log.messages(since=2))
    (1, 1, 0)
    """

    def __init__(self, server: MeshcatServer | None = None) -> None:
        self._server = server
        self._messages: dict[tuple[str, str, str], tuple[int, str]] = {}
        self._count = 0
        self._changed = threading.Condition()

    def send(self, command: Any) -> None:
        """Keep a command of meshcat, and pass it on; what is seen through the solids is drawn after them."""
        data: Command = command.lower()
        if data["type"] == "set_object" and not data["object"]["materials"][0].get("depthTest", True):
            data["object"]["object"].setdefault("renderOrder", FRONT)
        self.forward(data)

    def forward(self, command: Command) -> None:
        """Keep ``command``, and pass it on to the server, if there is one."""
        self.add(command)
        if self._server is not None:
            self._server.send(command)

    def add(self, command: Command) -> None:
        """Keep ``command``."""
        with self._changed:
            if command["type"] == "set_object":
                command = command | {"object": dict(command["object"])}
                for geometry in command["object"].pop("geometries"):
                    key = ("set_geometry", geometry["uuid"], "")
                    if key not in self._messages:
                        self._keep(key, {"type": "set_geometry", "path": geometry["uuid"], "geometry": geometry})
            self._keep((command["type"], command["path"], command.get("property", "")), command)
            self._changed.notify_all()

    def _keep(self, key: tuple[str, str, str], command: Command) -> None:
        self._messages.pop(key, None)
        self._count += 1
        self._messages[key] = self._count, base64.b64encode(umsgpack.packb(command)).decode("ascii")

    def messages(self, since: int = 0) -> list[str]:
        """What builds the scene, or brings one of ``since`` commands up to date: msgpack in base64, oldest first."""
        return [message for number, message in self._messages.values() if number > since]

    def news(self, query: Mapping[str, str]) -> dict[str, Any]:
        """What a page asks for that has the first ``since`` commands, as soon as there is more, or after a while."""
        since = int(query.get("since", 0))
        with self._changed:
            self._changed.wait_for(lambda: self._count > since, _TIMEOUT)
            return {"messages": self.messages(since), "count": self._count}


class PageServer(ThreadingTCPServer):
    """Serves a page at ``url``, in a thread, until it is closed: the page itself, its commands, and its questions.

    A request under a foreign name is refused: a page elsewhere whose name is pointed here may not read along.
    Raises InputError if a ``port`` that was named, or every port from 7000 on, is taken, or ``host`` is not ours.
    """

    allow_reuse_address = daemon_threads = True

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        self.names = {"localhost", text("host", host).lower(), socket.gethostname().lower()}
        self.replies, self.questions = dict[str, Answer](), threading.Lock()
        if port is not None:
            whole("port", port, least=0, most=65535)
        ports = range(PORT, PORT + PORTS) if port is None else (port,)
        for candidate in ports:
            try:
                self.address_family = socket.getaddrinfo(host or "(none)", candidate, type=socket.SOCK_STREAM)[0][0]
                super().__init__((host, candidate), _Handler)
                break
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or str(error)
                if candidate == ports[-1] or getattr(error, "errno", None) != errno.EADDRINUSE:
                    where = f"from {PORT} to {PORT + PORTS - 1}" if port is None else f"port {port}"
                    advice = "" if port is None else "; leave --port out to take a free one"
                    raise InputError(f"cannot serve the viewer on {host!r} {where}: {reason}{advice}") from None
        self.port: int = self.socket.getsockname()[1]
        self.url = f"http://{host}:{self.port}/"
        self._thread = threading.Thread(target=self.serve_forever, args=(0.1,), name="clamp3d viewer", daemon=True)

    def start(self, page: Callable[[], str], log: CommandLog, answer: Answer) -> None:
        """Serve ``page()``, which follows the commands in ``log`` and whose questions ``answer`` answers."""
        self.replies |= {"/": lambda query: page(), "/commands": log.news, "/answer": answer}
        self._thread.start()

    def close(self) -> None:
        """Stop listening and end the thread. A second call does nothing."""
        if self._thread.is_alive():
            self.shutdown()
            self._thread.join()
        self.server_close()

    def handle_error(self, *_: object) -> None:
        """A page that went away before it had its reply is no error."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer

    def do_GET(self) -> None:
        name = urlsplit(f"//{self.headers.get('Host', '')}").hostname or ""
        if name not in self.server.names and not _is_address(name):
            return self.send_error(403)
        place = urlsplit(self.path)
        if place.path not in self.server.replies:
            return self.send_error(404)
        status, content = self._reply(place.path, dict(parse_qsl(place.query)))
        is_page = isinstance(content, str)
        body = (content if is_page else json.dumps(content)).encode("utf-8", "backslashreplace")
        self.send_response(status)
        self.send_header("Content-Type", "text/html; charset=utf-8" if is_page else "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(body)

    def _reply(self, path: str, query: dict[str, str]) -> tuple[int, Any]:
        """Status and content; measuring takes one question after the other."""
        try:
            with self.server.questions if path == "/answer" else contextlib.nullcontext():
                return 200, self.server.replies[path](query)
        except Exception as error:  # a question that fails is not the end of the page
            return 400 if isinstance(error, (Clamp3dError, ValueError)) else 500, {"error": str(error)}

    def log_message(self, *_: object) -> None:
        pass


def _is_address(name: str) -> bool:
    with contextlib.suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    return False


class MeshcatServer:
    """A meshcat server that is running; ``zmq_url`` is what ``meshcat-server`` prints, tcp://HOST:PORT.

    It keeps the scene when we leave. Raises InputError if the address is not one, Clamp3dError if nobody answers.
    """

    def __init__(self, zmq_url: str) -> None:
        from meshcat.visualizer import ViewerWindow

        if not text("url", zmq_url).startswith(("tcp://", "ipc://")):
            raise InputError(f"--url must be the zmq_url that meshcat-server prints (tcp://HOST:PORT), got {zmq_url!r}")
        ViewerWindow.context.RCVTIMEO = ViewerWindow.context.SNDTIMEO = int(1000 * _TIMEOUT)
        ViewerWindow.context.LINGER = 0
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                self._window = ViewerWindow(zmq_url, start_server=False, server_args=[])
        except zmq.Again:
            raise Clamp3dError(f"no meshcat server answers at {zmq_url} (waited {_TIMEOUT:g} s)") from None
        except zmq.ZMQError as error:
            raise InputError(f"--url {zmq_url}: {error}") from None
        self.url: str = self._window.web_url

    def send(self, command: Command) -> None:
        """Pass a command on. Raises Clamp3dError if the server has gone."""
        try:
            self._window.send(SimpleNamespace(lower=lambda: command))
        except zmq.ZMQError as error:
            raise Clamp3dError(f"the meshcat server at {self.url} does not answer any more: {error}") from None
