"""Fixed-width text tables for the terminal."""

from __future__ import annotations

import io
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
    from rich.console import Console
    from rich.table import Table

    cells = [["-" if cell is None else str(cell) for cell in row] for row in rows]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for i, title in enumerate(head):
        numbers = all(_NUMBER.fullmatch(row[i]) for row in cells if i < len(row))
        table.add_column(title, justify="right" if numbers else "left", no_wrap=True)
    for row in cells:
        table.add_row(*row)
    console = Console(file=io.StringIO(), width=10_000, color_system=None, markup=False, emoji=False, highlight=False)
    with console.capture() as text:
        console.print(table)
    return "\n".join((" " * indent + line).rstrip() for line in text.get().splitlines())
