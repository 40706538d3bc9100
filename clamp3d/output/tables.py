"""Fixed-width text tables for the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?( %)?|-|")


def text_table(head: Sequence[str], rows: Iterable[Sequence[object]], *, indent: int = 0) -> str:
    """Lay out rows under a head, each column as wide as its longest cell.

    Parameters
    ----------
    head : sequence of str
        Titles of the columns.
    rows : iterable of sequences
        Cells; None is shown as "-". A row that is shorter than the head leaves its last cells empty.
    indent : int
        Blanks before every line.

    Returns
    -------
    str
        Lines without trailing blanks. Columns of numbers are aligned to the right.

    Examples
    --------
    >>> print(text_table(["part", "gap"], [["P1", 1.5], ["P12", "12.25"]]))
    part    gap
    P1      1.5
    P12   12.25
    """
    cells = [["-" if cell is None else str(cell) for cell in row] for row in rows]
    cells = [row + [""] * (len(head) - len(row)) for row in cells]
    lines = [""] * (1 + len(cells))
    for title, *column in zip(head, *cells, strict=True):
        numbers = all(_NUMBER.fullmatch(cell) for cell in column)
        width = max(_width(cell) for cell in (title, *column))
        for k, cell in enumerate((title, *column)):
            blanks = " " * (width - _width(cell))
            lines[k] += (blanks + cell if numbers else cell + blanks) + "  "
    return "\n".join((" " * indent + line).rstrip() for line in lines)


def _width(cell: str) -> int:
    """Columns of a terminal that a text takes."""
    if cell.isascii() and cell.isprintable():
        return len(cell)
    from rich.cells import cell_len

    return cell_len(cell)
