"""The package's imports: no cycles between modules or packages, lazy imports counted; results know no pages."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "python" / "palpate"

# A package imports only from those before it. The modules at the top (errors, files, units, checks) come first.
ORDER = (
    "_core",
    "arrays",
    "errors",
    "units",
    "files",
    "checks",
    "devices",
    "contact",
    "control",
    "linear",
    "fem",
    "scenario",
    "simulation",
    "metrics",
    "stability",
    "tuning",
    "sweeps",
    "identification",
    "plotting",
    "report",
    "cli",
    "__main__",
)


def _modules() -> dict[str, Path]:
    """Return every module by its name; the lazy facade `palpate/__init__.py` is left out."""
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        parts = path.relative_to(SOURCE.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    found.pop("palpate")
    return found


def _imports(path: Path, modules: dict[str, Path]) -> set[str]:
    """Return the names of all modules that a file imports, at its top, lazily or for type checking alone."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute"
            base = node.module or ""
            for alias in node.names:
                name = f"{base}.{alias.name}"
                found.add(name if name in modules or base == "palpate" else base)
    return found


MODULES = _modules()
IMPORTS = {name: _imports(path, MODULES) for name, path in MODULES.items()}


def _package(module: str) -> str:
    return module.split(".")[1]


def test_every_package_has_its_place_in_the_order() -> None:
    assert {_package(name) for name in MODULES} | {"_core"} == set(ORDER)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_imports_only_what_comes_before_its_package(module: str) -> None:
    rank = ORDER.index(_package(module))
    for other in IMPORTS[module]:
        if other.startswith("palpate.") and _package(other) != _package(module):
            assert ORDER.index(_package(other)) < rank, f"{module} imports {other}"


def test_no_module_imports_itself_through_others() -> None:
    """Lazy imports and those for type checking are counted; importing a package is importing its `__init__`."""
    graph = {name: {other for other in found if other in MODULES and other != name} for name, found in IMPORTS.items()}
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as cycle:
        pytest.fail(" imports ".join(cycle.args[1]))


@pytest.mark.parametrize("module", MODULES)
def test_nothing_in_the_package_imports_studies_or_the_facade(module: str) -> None:
    for other in IMPORTS[module]:
        assert other.split(".")[0] not in ("experiments", "benchmarks", "tests"), f"{module} imports {other}"
        assert other != "palpate", f"{module} imports the package itself"


def test_no_public_function_shadows_its_module() -> None:
    """`palpate.stability.zwidth` cannot be a function and a module at once."""
    for name, path in MODULES.items():
        if path.name == "__init__.py":
            submodules = {other.rpartition(".")[2] for other in MODULES if other.rpartition(".")[0] == name}
            exported = {
                alias.asname or alias.name
                for node in ast.parse(path.read_text("utf-8")).body
                if isinstance(node, ast.ImportFrom)
                for alias in node.names
            }
            assert not exported & submodules, name
