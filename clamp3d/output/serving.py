"""Where a scene goes: a page served by the standard library's web server, or a meshcat server that is running."""

from __future__ import annotations

import contextlib
import io
import ipaddress
import socket
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import umsgpack
import zmq

from clamp3d.checks import shown, text, whole
from clamp3d.errors import Clamp3dError, InputError

PORT, PORTS = 7000, 200
"""First port tried, meshcat's own, and how many are tried; unless the user named one."""
_TIMEOUT = 10.0  # s for an answer of a meshcat server

Command = dict[str, Any]


class CommandLog:
    """The commands that still matter, in order: a later one replaces an earlier one of the same kind at its place.

    The geometry of objects is a command of its own, which our page knows: it is kept once, however many have it.

    >>> log = CommandLog()
    >>> for x in (1.0, 2.0):
    ...     log.add({"type": "set_property", "path": "/a", "property": "scale", "value": [x, x, x]})
    >>> len(log.messages())
    1
    """

    def __init__(self) -> None:
        self._messages: dict[tuple[str, str, str], bytes] = {}

    def add(self, command: Command) -> None:
        """Keep ``command`` as a message (msgpack) that our page reads."""
        if command["type"] == "set_object":
            command = command | {"object": dict(command["object"])}
            for geometry in command["object"].pop("geometries"):
                data = {"type": "set_geometry", "path": geometry["uuid"], "geometry": geometry}
                key = (data["type"], data["path"], "")
                if key not in self._messages:
                    self._messages[key] = umsgpack.packb(data)
        key = (command["type"], command["path"], command.get("property", ""))
        self._messages.pop(key, None)
        self._messages[key] = umsgpack.packb(command)

    def messages(self) -> list[bytes]:
        """All messages that build the scene, oldest first."""
        return list(self._messages.values())


class PageServer:
    """Serves what ``page()`` returns at ``url``, in a thread, until it is closed.

    A request under a foreign name is refused: a page elsewhere whose name is pointed here may not read along.
    Raises InputError if a ``port`` that was named, or every port from 7000 on, is taken, or ``host`` is not ours.
    """

    def __init__(self, page: Callable[[], str], *, host: str = "127.0.0.1", port: int | None = None) -> None:
        own_names = {"localhost", text("host", host).lower(), socket.gethostname().lower()}

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                name = urlsplit(f"//{self.headers.get('Host', '')}").hostname or ""
                if name not in own_names and not _is_address(name):
                    self.send_error(HTTPStatus.FORBIDDEN)
                elif self.path not in ("/", "/index.html"):
                    self.send_error(HTTPStatus.NOT_FOUND)
                else:
                    content = page().encode("utf-8", "backslashreplace")
                    self.send_response(HTTPStatus.OK)
                    for key, value in (("Content-Type", "text/html; charset=utf-8"), ("Cache-Control", "no-store")):
                        self.send_header(key, value)
                    self.send_header("Content-Length", str(len(content)))
                    self.end_headers()
                    with contextlib.suppress(ConnectionError):
                        self.wfile.write(content)

            def log_message(self, *_: object) -> None:
                pass

        self._server = _bind(Handler, host, port)
        self.port: int = self._server.server_address[1]
        self.url = f"http://{host}:{self.port}/"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), name="clamp3d viewer")
        self._thread.daemon = True
        self._thread.start()

    def close(self) -> None:
        """Stop listening and end the thread. A second call does nothing."""
        if self._thread.is_alive():
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()

    def __enter__(self) -> PageServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    allow_reuse_address = False


def _is_address(name: str) -> bool:
    with contextlib.suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    return False


def _bind(handler: type[BaseHTTPRequestHandler], host: str, port: int | None) -> ThreadingHTTPServer:
    """A server on ``port``, or on the first free one. Raises InputError if there is none."""
    if port is not None:
        whole("port", port, least=0, most=65535)
    try:
        socket.getaddrinfo(host or "(none)", None)
    except (OSError, ValueError):
        raise InputError(f"host must be the name or an address of this machine, got {shown(host)}") from None
    for candidate in range(PORT, PORT + PORTS) if port is None else (port,):
        try:
            return _Server((host, candidate), handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
    if port is None:
        raise InputError(f"no free port for the viewer on {host} from {PORT} to {PORT + PORTS - 1}: {reason}")
    raise InputError(f"cannot serve the viewer on {host} port {port}: {reason}; leave --port out to take a free one")


class MeshcatServer:
    """A meshcat server that is running; ``zmq_url`` is what ``meshcat-server`` prints, tcp://HOST:PORT.

    It keeps the scene when we leave. Raises InputError if the address is not one, Clamp3dError if nobody answers.
    """

    def __init__(self, zmq_url: str) -> None:
        from meshcat.visualizer import ViewerWindow

        if not zmq_url.startswith(("tcp://", "ipc://")):
            raise InputError(f"--url must be the zmq_url that meshcat-server prints (tcp://HOST:PORT), got {zmq_url!r}")
        ViewerWindow.context.RCVTIMEO = ViewerWindow.context.SNDTIMEO = int(1000 * _TIMEOUT)
        ViewerWindow.context.LINGER = 0
        self._zmq_url = zmq_url
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                self._window = ViewerWindow(zmq_url, start_server=False, server_args=[])
        except zmq.Again:
            raise self._silent() from None
        except zmq.ZMQError as error:
            raise InputError(f"--url {zmq_url}: {error}") from None
        self.url: str = self._window.web_url

    def send(self, command: Command) -> None:
        """Pass a command on. Raises Clamp3dError if the server has gone."""
        try:
            self._window.send(SimpleNamespace(lower=lambda: command))
        except zmq.ZMQError:
            raise self._silent() from None

    def _silent(self) -> Clamp3dError:
        return Clamp3dError(f"no meshcat server answers at {self._zmq_url} (waited {_TIMEOUT:g} s)")
