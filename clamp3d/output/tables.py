"""Tables: of fixed width for the terminal, and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from clamp3d.errors import escaped

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
    from rich.text import Text

    cells = [["-" if cell is None else escaped(str(cell)) for cell in row] for row in rows]
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), show_edge=False)
    for k, title in enumerate(head):
        numeric = all(_NUMBER.fullmatch(row[k]) for row in cells if k < len(row))
        table.add_column(Text(title), justify="right" if numeric else "left", no_wrap=True)
    for row in cells:
        table.add_row(*map(Text, row))
    console = Console(width=100_000, color_system=None, legacy_windows=False)
    with console.capture() as captured:
        console.print(table)
    return "\n".join((" " * indent + line).rstrip() for line in captured.get().splitlines())


def csv_table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] = ()) -> str:
    """Rows as CSV with a header: ``columns``, or every key that a row has. None is an empty cell.

    >>> csv_table([{"a": "P1", "gap": 1.5}, {"a": "P2", "t": None}])
    'a,gap,t\\nP1,1.5,\\nP2,,\\n'
    """
    out = io.StringIO()
    head = columns or list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(out, head, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return out.getvalue()
