"""Where a scene goes: a page served by tornado, as meshcat's own is, or a meshcat server that is running.

Meshcat's server cannot do what the page needs: it has one fixed page, listens on every address of the machine, and
answers no questions.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import io
import ipaddress
import socket
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace
from typing import Any
from urllib.parse import urlsplit

import umsgpack
import zmq
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from clamp3d.checks import text, whole
from clamp3d.errors import Clamp3dError, InputError

PORT, PORTS = 7000, 200
"""First port tried, meshcat's own, and how many are tried; unless the user named one."""
_TIMEOUT = 10.0  # s for an answer of a meshcat server

Command = dict[str, Any]
Answer = Callable[[Mapping[str, str]], dict[str, Any]]


class CommandLog:
    """The commands that still matter, in order: a later one replaces an earlier one of the same kind at its place.

    The geometry of objects is a command of its own, which our page knows: it is kept once, however many have it.

    >>> log = CommandLog()
    >>> for x in (1.0, 2.0):
    ...     _ = log.add({"type": "set_property", "path": "/a", "property": "scale", "value": [x, x, x]})
    >>> len(log.messages())
    1
    """

    def __init__(self) -> None:
        self._messages: dict[tuple[str, str, str], bytes] = {}

    def add(self, command: Command) -> list[bytes]:
        """Keep ``command``; the new messages (msgpack) that our page reads."""
        new = []
        if command["type"] == "set_object":
            command = command | {"object": dict(command["object"])}
            for geometry in command["object"].pop("geometries"):
                key = ("set_geometry", geometry["uuid"], "")
                if key not in self._messages:
                    data = {"type": "set_geometry", "path": geometry["uuid"], "geometry": geometry}
                    self._messages[key] = umsgpack.packb(data)
                    new.append(self._messages[key])
        key = (command["type"], command["path"], command.get("property", ""))
        self._messages.pop(key, None)
        self._messages[key] = umsgpack.packb(command)
        return [*new, self._messages[key]]

    def messages(self) -> list[bytes]:
        """All messages that build the scene, oldest first."""
        return list(self._messages.values())


class PageServer:
    """Serves a page at ``url``, in a thread, until it is closed: the page itself, its commands, and its questions.

    A request under a foreign name is refused: a page elsewhere whose name is pointed here may not read along.
    Raises InputError if a ``port`` that was named, or every port from 7000 on, is taken, or ``host`` is not ours.
    """

    def __init__(self, host: str = "127.0.0.1", port: int | None = None) -> None:
        self.names = {"localhost", text("host", host).lower(), socket.gethostname().lower()}
        self._sockets = _bind(host, port)
        self.port: int = self._sockets[0].getsockname()[1]
        self.url = f"http://{host}:{self.port}/"
        self.pages: set[WebSocketHandler] = set()
        self.work = ThreadPoolExecutor(1, "clamp3d viewer")
        self._loop, self._closed = asyncio.new_event_loop(), asyncio.Event()
        self._thread: threading.Thread | None = None

    def start(self, page: Callable[[], str], messages: Callable[[], list[bytes]], answer: Answer) -> None:
        """Serve ``page()``, which gets ``messages()`` and all that follow, and whose questions ``answer`` answers."""
        handlers: list[tuple[str, Any, dict[str, Any]]] = [
            ("/", _Page, {"server": self, "page": page, "messages": messages}),
            ("/answer", _Answer, {"server": self, "answer": answer}),
        ]
        serving = self._serve(Application(handlers, log_function=lambda handler: None))
        self._thread = threading.Thread(target=self._loop.run_until_complete, args=(serving,), name="clamp3d viewer")
        self._thread.daemon = True
        self._thread.start()

    async def _serve(self, application: Application) -> None:
        server = HTTPServer(application)
        server.add_sockets(self._sockets)
        await self._closed.wait()
        server.stop()
        for page in self.pages.copy():
            page.close()
        await server.close_all_connections()

    def send(self, messages: list[bytes]) -> None:
        """Pass messages on to the pages that are open."""
        if self._thread is not None:
            self._loop.call_soon_threadsafe(self._broadcast, messages)

    def _broadcast(self, messages: list[bytes]) -> None:
        for page in self.pages.copy():
            with contextlib.suppress(WebSocketClosedError):
                for message in messages:
                    page.write_message(message, binary=True)

    def close(self) -> None:
        """Stop listening and end the thread. A second call does nothing."""
        if self._thread is not None:
            self._loop.call_soon_threadsafe(self._closed.set)
            self._thread.join()
            self.work.shutdown(cancel_futures=True)
            self._thread = None
        for own in self._sockets:
            own.close()


class _Handler(RequestHandler):
    """Refuses requests under a foreign name."""

    def prepare(self) -> None:
        name = urlsplit(f"//{self.request.headers.get('Host', '')}").hostname or ""
        if name not in self.own_server.names and not _is_address(name):
            raise HTTPError(403)

    def initialize(self, server: PageServer, **functions: Callable[..., Any]) -> None:
        self.own_server = server
        self.__dict__.update(functions)


class _Page(_Handler, WebSocketHandler):
    """The page, and its commands at the same address, where meshcat's viewer looks for them."""

    page: Callable[[], str]
    messages: Callable[[], list[bytes]]

    async def get(self) -> None:
        if self.request.headers.get("Upgrade", "").lower() == "websocket":
            await super().get()
        else:
            self.set_header("Cache-Control", "no-store")
            self.finish(self.page().encode("utf-8", "backslashreplace"))

    def open(self) -> None:
        for message in self.messages():
            self.write_message(message, binary=True)
        self.own_server.pages.add(self)

    def on_message(self, message: str | bytes) -> None:
        pass

    def on_close(self) -> None:
        self.own_server.pages.discard(self)


class _Answer(_Handler):
    """What a page asks while somebody looks at it, one question after the other."""

    answer: Answer

    async def get(self) -> None:
        query = {key: self.get_argument(key) for key in self.request.arguments}
        try:
            self.write(await asyncio.get_running_loop().run_in_executor(self.own_server.work, self.answer, query))
        except Exception as error:  # a question that fails is not the end of the page
            self.set_status(400 if isinstance(error, Clamp3dError) else 500)
            self.write({"error": str(error)})


def _is_address(name: str) -> bool:
    with contextlib.suppress(ValueError):
        return bool(ipaddress.ip_address(name))
    return False


def _bind(host: str, port: int | None) -> list[socket.socket]:
    """Sockets on ``port``, or on the first free one. Raises InputError if there is none."""
    if port is not None:
        whole("port", port, least=0, most=65535)
    for candidate in range(PORT, PORT + PORTS) if port is None else (port,):
        try:
            return bind_sockets(candidate, host or "(none)")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            if getattr(error, "errno", None) != errno.EADDRINUSE:
                break
    where = f"from {PORT} to {PORT + PORTS - 1}" if port is None else f"port {port}"
    advice = "" if port is None else "; leave --port out to take a free one"
    raise InputError(f"cannot serve the viewer on {host!r} {where}: {reason}{advice}")


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
