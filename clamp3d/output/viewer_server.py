"""Where a scene goes: a web server of our own in a thread, or a meshcat server that is already running.

Our own server speaks meshcat's protocol to its viewer (three.js, from the meshcat package). Meshcat's is a process that
shows its own page, to every page that asks; ours shows our page, checks who asks, and ends with this process.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Any

import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket
import umsgpack
import zmq

from clamp3d.checks import shown, text, whole
from clamp3d.errors import Clamp3dError, InputError
from clamp3d.output.viewer_page import viewer_files

PORT = 7000
"""First port tried, meshcat's own; the next free one is taken unless the user named it."""
_PORTS = 200
_PATIENCE = 10.0  # s for a server that is said to be running
_FAREWELL = 0.1  # s for the pages when we close

Command = dict[str, Any]


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
        """Keep ``command`` and return what of it is new, as messages (msgpack) that our page reads."""
        new = []
        if command["type"] == "set_object":
            command = command | {"object": dict(command["object"])}
            for geometry in command["object"].pop("geometries"):
                key = ("set_geometry", geometry["uuid"], "")
                if key not in self._messages:
                    new.append(umsgpack.packb({"type": key[0], "path": key[1], "geometry": geometry}))
                    self._messages[key] = new[-1]
        key = (command["type"], command["path"], command.get("property", ""))
        self._messages.pop(key, None)
        self._messages[key] = umsgpack.packb(command)
        return [*new, self._messages[key]]

    def messages(self) -> list[bytes]:
        """All messages that build the scene, oldest first."""
        return list(self._messages.values())


class LocalServer:
    """What ``page()`` returns at ``url``, and the scene, for any number of browsers. Use as a context, or `close`.

    A request under a foreign name is refused: a page elsewhere whose name is made to point here may not read along.
    Raises InputError if a ``port`` that was asked for, or every port from 7000 on, is taken, or ``host`` is not ours.
    """

    def __init__(
        self, page: Callable[[], str], log: CommandLog, *, host: str = "127.0.0.1", port: int | None = None
    ) -> None:
        self._page, self._log, self.host = page, log, text("host", host)
        self._clients: set[Any] = set()
        sockets = _bind(host, port)
        self.port: int = sockets[0].getsockname()[1]
        self.url = f"http://{host}:{self.port}/"
        self._ready, self._loop = threading.Event(), asyncio.new_event_loop()
        self._end = asyncio.Event()
        self._thread = threading.Thread(target=self._run, args=(sockets,), name="clamp3d viewer", daemon=True)
        self._thread.start()
        self._ready.wait()

    def send(self, command: Command, messages: Sequence[bytes]) -> None:
        """Pass a command to every page that is open, as its messages; never waits for a browser."""
        self._loop.call_soon_threadsafe(lambda: [c.push(message) for c in list(self._clients) for message in messages])

    def close(self) -> None:
        """Stop listening, drop the pages, end the thread. A second call does nothing."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join(timeout=10.0)

    def __enter__(self) -> LocalServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self, sockets: list[socket.socket]) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve(sockets))

    async def _serve(self, sockets: list[socket.socket]) -> None:
        server = tornado.httpserver.HTTPServer(self._application())
        server.add_sockets(sockets)
        self._ready.set()
        await self._end.wait()
        server.stop()
        for client in list(self._clients):
            client.close()
        await asyncio.sleep(_FAREWELL)  # a page answers the closing of its socket, or not
        await server.close_all_connections()
        for client in list(self._clients):
            client.ws_connection.stream.close()

    def _application(self) -> tornado.web.Application:
        owner = self

        class Own(tornado.web.RequestHandler):
            def prepare(self) -> None:
                if not owner._ours(self.request.host_name):
                    raise tornado.web.HTTPError(403)

        class Scene(Own, tornado.websocket.WebSocketHandler):
            def open(self, *_: str) -> None:
                owner._clients.add(self)
                for message in owner._log.messages():
                    self.push(message)

            def push(self, message: bytes) -> None:
                with contextlib.suppress(tornado.websocket.WebSocketClosedError):
                    self.write_message(message, binary=True)

            def on_message(self, message: str | bytes) -> None:
                pass  # the viewer only answers requests for pictures, and we make none

            def on_close(self) -> None:
                owner._clients.discard(self)

        class File(Own, tornado.web.StaticFileHandler):
            pass

        class Page(Own):
            def get(self) -> None:
                self.set_header("Cache-Control", "no-store")
                self.finish(owner._page())

        routes: list[Any] = [
            ("/scene", Scene),
            ("/(main.min.js)", File, {"path": str(viewer_files())}),
            ("/(?:index.html)?", Page),
        ]
        return tornado.web.Application(routes, log_function=lambda _: None)

    def _ours(self, name: str) -> bool:
        """Whether a request's Host is an address or a name of this machine."""
        with contextlib.suppress(ValueError):
            return bool(ipaddress.ip_address(name.strip("[]")))
        return name.lower() in {"localhost", self.host.lower(), socket.gethostname().lower()}


def _bind(host: str, port: int | None) -> list[socket.socket]:
    """Sockets on ``port``, or on the first free one. Raises InputError if there is none."""
    if port is not None:
        whole("port", port, least=0, most=65535)
    try:  # once, not for every port
        socket.getaddrinfo(host or "(none)", None)
    except (OSError, ValueError):
        raise InputError(f"host must be the name or an address of this machine, got {shown(host)}") from None
    for candidate in range(PORT, PORT + _PORTS) if port is None else (port,):
        try:
            return tornado.netutil.bind_sockets(candidate, address=host)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or str(error)
    if port is None:
        raise InputError(f"no free port for the viewer on {host} from {PORT} to {PORT + _PORTS - 1}: {why}")
    raise InputError(f"cannot serve the viewer on {host} port {port}: {why}; leave --port out to take a free one")


class RemoteServer:
    """A meshcat server that somebody else runs; ``zmq_url`` is what ``meshcat-server`` prints, tcp://HOST:PORT.

    It keeps the scene when we leave. Raises InputError if the address is not one, Clamp3dError if nobody answers.
    """

    def __init__(self, zmq_url: str) -> None:
        if not zmq_url.startswith(("tcp://", "ipc://")):
            raise InputError(f"--url must be the zmq_url that meshcat-server prints (tcp://HOST:PORT), got {zmq_url!r}")
        self.zmq_url, self._context = zmq_url, zmq.Context()
        self._socket = self._context.socket(zmq.REQ)
        for option in (zmq.RCVTIMEO, zmq.SNDTIMEO):
            self._socket.setsockopt(option, int(1000 * _PATIENCE))
        try:
            self._socket.connect(zmq_url)
            self.url = self._ask(b"url")
        except zmq.ZMQError as error:
            self.close()
            raise InputError(f"--url {zmq_url}: {error}") from None
        except BaseException:
            self.close()
            raise

    def send(self, command: Command, messages: Sequence[bytes]) -> None:
        """Pass a command on, whole as meshcat knows it. Raises Clamp3dError if the server has gone."""
        self._ask(command["type"].encode(), command["path"].encode(), umsgpack.packb(command))

    def close(self) -> None:
        """Leave the server to itself. A second call does nothing."""
        self._context.destroy(linger=0)

    def _ask(self, *frames: bytes) -> str:
        try:
            self._socket.send_multipart(frames)
            answer: str = self._socket.recv().decode("utf-8", "replace")
        except zmq.Again:
            raise Clamp3dError(f"no meshcat server answers at {self.zmq_url} (waited {_PATIENCE:g} s)") from None
        if answer.startswith("error"):
            raise Clamp3dError(f"meshcat server at {self.zmq_url}: {answer}")
        return answer
