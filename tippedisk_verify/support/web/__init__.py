"""Stand-alone pages: the templates and the style that they all share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["render"]


def render(
    package: str, template: str, filters: dict[str, Callable[..., Any]] | None = None, **values: Any
) -> str:
    """Render a template of a package; in HTML every value is escaped.

    HTML templates extend ``base.html`` of this package, which holds the style sheet. The result
    needs no other file.

    Args:
        package: The name of the package that holds the template.
        template: The template's file name.
        filters: Jinja filters by name.
        values: The template's variables.

    Returns:
        The text of the page.
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader(__name__, ".")]),
        autoescape=template.endswith(".html"),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    environment.filters.update(filters or {})
    return environment.get_template(template).render(**values)
