"""Pages from the templates of this package; every page is one file that needs no other."""

from __future__ import annotations

import datetime
import math
import os
from functools import cache
from typing import Any

from clamp3d import __version__
from clamp3d.errors import InputError


def render(template: str, /, package: str = "clamp3d.output", **values: Any) -> str:
    """Fill in one of the files in a package's ``templates``: HTML and XML escape texts, a missing value is an error."""
    return str(_environment(package).get_template(template).render(**values))


def now() -> datetime.datetime:
    """The time in UTC, or the environment's SOURCE_DATE_EPOCH, so that equal results can be equal files.

    Raises InputError if that is set to anything but seconds since 1970.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return datetime.datetime.now(datetime.UTC)
    try:
        return datetime.datetime.fromtimestamp(int(epoch), datetime.UTC)
    except (ValueError, OverflowError, OSError):
        raise InputError(f"SOURCE_DATE_EPOCH must be whole seconds since 1970, got {epoch!r}") from None


@cache
def _environment(package: str) -> Any:
    import jinja2

    from clamp3d.output.palette import VERDICT_COLOURS
    from clamp3d.output.wording import contact_text, counted, distance_text

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(package, "templates"),
        autoescape=jinja2.select_autoescape(["html", "bcf", "bcfv"]),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.globals |= {"gap": distance_text, "contact_text": contact_text, "counted": counted}
    environment.globals |= {"degrees": math.degrees, "verdict_colours": VERDICT_COLOURS, "version": __version__}
    return environment
