"""Pages from the templates of this package."""

from __future__ import annotations


def render(template: str, **values: object) -> str:
    """Text of a template in ``bench/templates``; nothing is escaped unless the template says so."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("clamp3d.bench", "templates")
    pages = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, keep_trailing_newline=True)
    return pages.get_template(template).render(**values)
