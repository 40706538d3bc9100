"""What was sent to a meshcat scene, kept so that a page that opens later shows the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Command = dict[str, Any]
Send = Callable[[Command], None]


class CommandLog:
    """The commands that still matter, in order: a later one replaces an earlier one of the same kind at its place.

    >>> log = CommandLog()
    >>> for x in (1.0, 2.0):
    ...     _ = log.add({"type": "set_property", "path": "/a", "property": "scale", "value": [x, x, x]})
    >>> len(log.messages())
    1
    """

    def __init__(self) -> None:
        self._messages: dict[tuple[str, str, str], bytes] = {}

    def add(self, command: Command) -> bytes:
        """Keep ``command`` and return it as the message (msgpack) that the viewer reads."""
        import umsgpack

        message: bytes = umsgpack.packb(command)
        kind, path = command["type"], command.get("path", "")
        if kind == "delete":
            below = path.rstrip("/") + "/"
            self._messages = {k: m for k, m in self._messages.items() if k[1] != path and not k[1].startswith(below)}
            return message
        key = (kind, path, command.get("property", ""))
        self._messages.pop(key, None)
        self._messages[key] = message
        return message

    def messages(self) -> list[bytes]:
        """All messages that build the scene, oldest first."""
        return list(self._messages.values())
