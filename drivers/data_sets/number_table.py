"""Tables of numbers in text files, plain or gzipped, with one row per line."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from drivers.errors import LogFormatError
from drivers.log_lines import LogLineReader
from features.se2 import Array


def read_table(path: Path, columns: str) -> Array:
    """Read the rows of a table, shape (n, c); blank lines and those that begin with ``#`` are skipped.

    Parameters
    ----------
    path : the table; gzip data are recognised by their first bytes.
    columns : names of the columns, separated by blanks; if the first is `stamp`, its values must not decrease.

    Raises
    ------
    LogFormatError
        The file cannot be read or has no row, a row has not one finite number for each column, a stamp is smaller than
        the one before, or gzip data are damaged.
    """
    names = columns.split()
    rows: list[list[float]] = []
    for number, fields in table_rows(path, columns):
        row = finite_numbers(path, number, fields, columns)
        if len(row) != len(names):
            raise LogFormatError(f"{path}, line {number}: {len(row)} fields: expected `{columns}`")
        if names[0] == "stamp" and rows and row[0] < rows[-1][0]:
            raise LogFormatError(
                f"{path}, line {number}: stamp goes back by {rows[-1][0] - row[0]:.3f} s: expected stamps in order"
            )
        rows.append(row)
    if not rows:
        raise LogFormatError(f"{path} has no row: expected lines of `{columns}`")
    return np.array(rows)


def table_rows(path: Path, columns: str) -> Iterator[tuple[int, list[bytes]]]:
    """Yield number and fields of each line that is neither blank nor a comment."""
    for line in LogLineReader(path, f"lines of `{columns}`").lines():
        if line.suspect:
            raise LogFormatError(
                f"{path}, line {line.number}: the gzip data end early or are damaged: expected them whole"
            )
        fields = line.text.split()
        if not fields[0].startswith(b"#"):
            yield line.number, fields


def finite_numbers(path: Path, number: int, fields: list[bytes], columns: str) -> list[float]:
    """Values of the fields of a line; raises :class:`LogFormatError` where one is no finite number."""
    values: list[float] = []
    for field in fields:
        try:
            value = float(field)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or b"_" in field:
            shown = repr(field[:40].decode(errors="replace"))
            raise LogFormatError(f"{path}, line {number}: {shown} is no finite number: expected `{columns}`")
        values.append(value)
    return values
