"""Files of a study: tables as CSV and Markdown, summaries as JSON, settings as TOML."""

import csv
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import BaseModel

from slam.config_file import fill_table
from slam.errors import RunFolderError

SETTINGS = "settings.toml"


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of equal keys; floats with six digits, what is not known as an empty field.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(rows[0])
            writer.writerows([_field(value) for value in row.values()] for row in rows)
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Write a summary; a number that is not known becomes null.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    write_text(path, json.dumps(_known(value), indent=2, allow_nan=False) + "\n")


def write_settings(
    folder: Path, study: str, settings: BaseModel, tables: Mapping[str, BaseModel] | None = None
) -> None:
    """Write the effective settings of a study, each with its meaning and unit beside it.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    document = tomlkit.document()
    document.add("study", tomlkit.item(study))
    fill_table(document, settings)
    for name, model in (tables or {}).items():
        table = tomlkit.table()
        fill_table(table, model)
        document.add(name, table)
    write_text(folder / SETTINGS, tomlkit.dumps(document))


def write_text(path: Path, text: str) -> None:
    """Write a text file.

    Raises
    ------
    RunFolderError
        It cannot be written.
    """
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Lay rows out as a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _field(value: Any) -> Any:
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else ""
    return value


def _known(value: Mapping[str, Any] | list[Any] | tuple[Any, ...] | str | float | None) -> Any:
    if isinstance(value, Mapping):
        return {key: _known(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_known(item) for item in value]
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    return value


def write_picture(draw: Callable[..., None], path: Path, *arguments: object) -> None:
    """Write a picture by a function of :mod:`slam.pictures`.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    try:
        draw(path, *arguments)
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def fill(text: str, blocks: Mapping[str, str]) -> str:
    """Put each block between its marks ``<!-- name -->`` and ``<!-- end -->``.

    Raises
    ------
    RunFolderError
        A mark is missing.
    """
    for name, block in blocks.items():
        pattern = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not pattern.search(text):
            raise RunFolderError(f"the page has no place for {name!r}: expected <!-- {name} --> ... <!-- end -->")
        text = pattern.sub(lambda match, block=block: f"{match[1]}{block}\n{match[2]}", text)
    return text
