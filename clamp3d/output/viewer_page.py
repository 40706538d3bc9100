"""The viewer's page: meshcat's canvas with a panel and a time line; live, or with everything inside it."""

from __future__ import annotations

import base64
import importlib.util
from importlib import resources
from pathlib import Path

from clamp3d.errors import MissingLibraryError
from clamp3d.output.files import write_text
from clamp3d.output.viewer_log import CommandLog


def viewer_files() -> Path:
    """Folder with meshcat's built viewer. Raises MissingLibraryError if meshcat is not installed."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise MissingLibraryError("the viewer needs meshcat: pip install meshcat")
    return Path(spec.submodule_search_locations[0]) / "viewer" / "dist"


def live_page() -> str:
    """The page that our own server serves: it connects back and shows what comes."""
    return _page(title="clamp3d", meshcat='<script src="main.min.js"></script>', messages=[])


def write_page(path: Path, log: CommandLog, title: str) -> None:
    """Write the scene as one page that needs nothing else, not even a network. Raises InputError if it cannot."""
    folder = viewer_files()
    script = (folder / "main.min.js").read_text(encoding="utf-8").replace("</script", "<\\/script")
    notices = folder / "main.min.js.LICENSE.txt"
    licence = notices.read_text(encoding="utf-8").replace("--", "- -") if notices.exists() else ""
    meshcat = f"<!-- MeshCat viewer and three.js (MIT licence)\n{licence}-->\n<script>{script}</script>"
    messages = [base64.b64encode(message).decode("ascii") for message in log.messages()]
    write_text(path, _page(title=title, meshcat=meshcat, messages=messages))


def _page(*, title: str, meshcat: str, messages: list[str]) -> str:
    import jinja2

    folder = resources.files("clamp3d.output").joinpath("templates")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    template = environment.from_string(folder.joinpath("viewer.html").read_text(encoding="utf-8"))
    return template.render(
        title=title,
        style=folder.joinpath("viewer.css").read_text(encoding="utf-8"),
        script=folder.joinpath("viewer.js").read_text(encoding="utf-8"),
        meshcat=meshcat,
        messages=messages,
    )
