"""Reading of TOML text from unknown sources, and lines of its keys.

The parser takes time and memory that grow faster than the text for long dotted keys, so the structure of a text is
bounded before it is parsed.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

from palpate.errors import PalpateError
from palpate.files.json_text import unusable
from palpate.files.reading import TEXT_LIMIT

_HEADER: Final = re.compile(r"\s*\[\[?([^\[\]]+)\]\]?\s*(?:#.*)?$")
_KEY: Final = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")

_PART: Final = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""  # of a dotted key
_LONG_KEY: Final = re.compile(rf"(?<![\w-]){_PART}(?:{_PART}){{15}}")
_INNER_PART: Final = re.compile(r"""(?<=\.)[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+(?=\.)""")
_TABLE: Final = re.compile(r"""^[ \t]*+\[\[?[ \t]*+["'\w-]++[^,\n]*+$""", re.MULTILINE)
_MOST_TABLES: Final = 20_000
_MOST_INNER_PARTS: Final = 50_000


def load_toml(text: object, error: type[PalpateError], where: str) -> dict[str, Any]:
    """Return the tables of TOML text.

    Raises:
        error: it is no text, no TOML, too long or too deeply nested, or a number has too many digits. The message
            begins with `where` and the line.
    """
    if not isinstance(text, str):
        raise error(f"{where}: TOML text is needed, not {str(text)[:60]!r}")
    if len(text) > TEXT_LIMIT:
        raise error(f"{where}: {len(text)} characters; TOML text has at most {TEXT_LIMIT}")
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise error(f"{where}, line {line}: not usable TOML: a dotted key of more than 16 parts")
    for pattern, most, what in (
        (_TABLE, _MOST_TABLES, "tables"),
        (_INNER_PART, _MOST_INNER_PARTS, "dotted keys"),
    ):
        if sum(1 for _ in pattern.finditer(text)) > most:
            raise error(f"{where}: not usable TOML: more than {most} {what}")
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        place = re.search(r"\(at (?:line (\d+), column \d+|end of document)\)", str(problem))
        at = f", line {place[1]}" if place and place[1] else ""
        reason = str(problem).split(" (at ", maxsplit=1)[0]
        raise error(f"{where}{at}: not valid TOML: {reason[:1].lower()}{reason[1:]}") from None
    except RecursionError:
        raise error(f"{where}: not usable TOML: nested too deeply") from None
    except ValueError as problem:
        reason = "an integer of thousands of digits" if "digits" in str(problem) else str(problem)
        raise error(f"{where}: not usable TOML: {reason}") from None
    if reason := unusable(tables):
        raise error(f"{where}: not usable TOML: {reason}")
    return tables


def find_line(text: str, field: Sequence[str | int]) -> int | None:
    """Return the line, from 1, of a field such as ("object", "stiffness") in TOML text.

    For a missing field it is the line of the innermost table around it, or None.
    """
    lines = _lines_of_keys(text)
    wanted = tuple(part for part in field if isinstance(part, str))
    found = (lines.get(wanted[:length]) for length in range(len(wanted), 0, -1))
    return next((line for line in found if line is not None), None)


@lru_cache(maxsize=4)
def _lines_of_keys(text: str) -> dict[tuple[str, ...], int]:
    """Return the first line of every table and key. A field of an inline table is on the line of the table."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    depth, fence = 0, ""  # nesting of brackets over lines; open triple quotes
    for number, line in enumerate(text.splitlines(), start=1):
        here: tuple[str, ...] | None = None
        if depth == 0 and not fence:
            if header := _HEADER.match(line):
                here = table = _parts(header[1])
            elif key := _KEY.match(line):
                here = (*table, *_parts(key[1]))
        if here is not None:
            lines.setdefault(here, number)
        depth, fence = _nesting(line, depth, fence)
    return lines


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _nesting(line: str, depth: int, fence: str) -> tuple[int, str]:
    """Return bracket depth and open triple quote after a line."""
    if _HEADER.match(line) and depth == 0 and not fence:
        return 0, ""
    quote, at = "", 0
    while at < len(line):
        three, char = line[at : at + 3], line[at]
        if fence:
            if three == fence:
                fence, at = "", at + 2
        elif quote:
            if char == "\\" and quote == '"':
                at += 1
            elif char == quote:
                quote = ""
        elif three in ('"""', "'''"):
            fence, at = three, at + 2
        elif char in "\"'":
            quote = char
        elif char == "#":
            break
        elif char in "[{":
            depth += 1
        elif char in "]}":
            depth = max(0, depth - 1)
        at += 1
    return depth, fence
