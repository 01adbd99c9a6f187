"""Every public name of the C++ core is documented."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

INCLUDE = Path(__file__).parents[2] / "core/include/palpate"
DECLARATION = re.compile(r"^(?:class|struct|enum class|concept) (?:alignas\(\d+\) )?(\w+)(?![\w<])")


def undocumented(text: str) -> list[str]:
    """Return the types at namespace scope that no `///` comment precedes; specializations and detail are exempt."""
    missing: list[str] = []
    previous = ""
    in_detail = False
    for line in text.splitlines():
        if line.startswith("namespace detail") or line.startswith("namespace Eigen"):
            in_detail = True
        elif line.startswith("}  // namespace"):
            in_detail = False
        found = DECLARATION.match(line)
        declared_only = line.startswith(("class", "struct")) and line.endswith(";")
        if found and not in_detail and not declared_only and not previous.startswith("///"):
            missing.append(found[1])
        if line and not line.startswith(("template", "  requires", "[[")):
            previous = line
    return missing


@pytest.mark.parametrize("header", sorted(INCLUDE.rglob("*.hpp")), ids=lambda p: str(p.relative_to(INCLUDE)))
def test_every_public_type_has_a_comment(header: Path) -> None:
    assert undocumented(header.read_text()) == []


def test_the_check_sees_a_type_without_comment() -> None:
    assert undocumented("/// Known.\nclass A {\n};\n\ntemplate <class T>\nstruct B {\n};\n") == ["B"]
