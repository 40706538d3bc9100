"""The viewer's page: meshcat's canvas with a panel and a time line; live, or with everything inside it."""

from __future__ import annotations

import base64
import importlib.util
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from clamp3d import __version__
from clamp3d.errors import MissingLibraryError
from clamp3d.output.wording import gap_text


def viewer_files() -> Path:
    """Folder with meshcat's built viewer. Raises MissingLibraryError if meshcat is not installed."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise MissingLibraryError("the viewer needs meshcat: pip install meshcat")
    return Path(spec.submodule_search_locations[0]) / "viewer" / "dist"


def panel(context: dict[str, Any]) -> str:
    """What the page says beside the picture, as HTML that can be read without any script."""
    return _render("viewer.panel.html", **context, version=__version__, gap=gap_text)


def live_page(title: str, told: str) -> str:
    """The page that our own server serves: it connects back and shows what comes."""
    return _page(title, told, meshcat='<script src="main.min.js"></script>', messages=())


def whole_page(title: str, told: str, messages: Sequence[bytes]) -> str:
    """The scene as one page that needs nothing else, not even a network."""
    folder = viewer_files()
    script = (folder / "main.min.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    notices = folder / "main.min.js.LICENSE.txt"
    licence = notices.read_text(encoding="utf-8").replace("--", "- -") if notices.exists() else ""
    meshcat = f"<!-- MeshCat viewer and three.js (MIT licence)\n{licence}-->\n<script>{script}</script>"
    return _page(title, told, meshcat=meshcat, messages=[base64.b64encode(m).decode("ascii") for m in messages])


def _page(title: str, told: str, **more: Any) -> str:
    folder = resources.files("clamp3d.output").joinpath("templates")
    style, script = (folder.joinpath(f"viewer.{kind}").read_text(encoding="utf-8") for kind in ("css", "js"))
    return _render("viewer.html", title=title, panel=told, style=style, script=script, **more)


def _render(template: str, **values: Any) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("clamp3d.output", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(template).render(values)
