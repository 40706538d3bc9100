"""The viewer's page: meshcat's canvas with a panel and a time line; live, or with everything inside it."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from clamp3d import __version__
from clamp3d.output.pages import render
from clamp3d.output.wording import distance_text


def viewer_files() -> Path:
    """Folder with meshcat's built viewer."""
    import meshcat

    return Path(meshcat.__file__).parent / "viewer" / "dist"


def panel(context: dict[str, Any]) -> str:
    """What the page says beside the picture, as HTML that can be read without any script."""
    return render("viewer.panel.html", **context, version=__version__, gap=distance_text, degrees=math.degrees)


def live_page(title: str, told: str) -> str:
    """The page that our own server serves: it connects back and shows what comes."""
    return render("viewer.html", title=title, panel=told, meshcat='<script src="main.min.js"></script>', messages=())


def whole_page(title: str, told: str, messages: Sequence[bytes]) -> str:
    """The scene as one page that needs nothing else, not even a network."""
    folder = viewer_files()
    script = (folder / "main.min.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    notices = folder / "main.min.js.LICENSE.txt"
    licence = notices.read_text(encoding="utf-8").replace("--", "- -") if notices.exists() else ""
    meshcat = f"<!-- MeshCat viewer and three.js (MIT licence)\n{licence}-->\n<script>{script}</script>"
    coded = [base64.b64encode(m).decode("ascii") for m in messages]
    return render("viewer.html", title=title, panel=told, meshcat=meshcat, messages=coded)
