"""Run mutation tests of the Python source: `python tests/support/mutate.py --count 200 --seed 1`.

A mutant is one small change: another comparison, sign, operator, constant or order of arguments, a dropped statement or
guard. First each test file runs once in a copy of the repository, to record the time of its tests and the functions
that they enter; build/mutate keeps these records until the test file changes. Then a mutant meets the tests that enter
its function, first those of the folder that mirrors its own, until one fails. A mutant that no test notices survives.
Survivors that change no result are listed with the reason in equivalent_mutants.toml. They meet the tests like all
others; both rates are printed, and a listed mutant that a test notices is an error of the list. A test that fails
without the mutant too is left out. Tests that use five times their processor time and 30 s more count as "hang"; those
that merely wait longer count as "timeout", which is no result. One process runs at low priority. It collects all tests
once and forks for each mutant, whose code replaces that of the live function; a mutant outside of functions is written
to the copy instead, as is one that survives in a function that makes others.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import math
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
from collections import Counter, defaultdict
from collections.abc import Callable, Generator
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType
from typing import Any, Final

import pytest
from mutants import Mutant, mutants

ROOT: Final = Path(__file__).parents[2]
PACKAGE: Final = Path("python/palpate")
PRELOADED: Final = ("numpy", "scipy.linalg", "scipy.signal", "scipy.optimize", "h5py", "pint", "typer", "hypothesis")
SKIPPED: Final = ("benchmarks", "core", "support")  # folders of tests
MEMORY: Final = 12 << 30  # bytes of address space of one run of tests
PATIENCE: Final = 6.0  # time on the clock over processor time of one run of tests
OWN: Final = {"palpate", "experiments", "benchmarks", "tests"} | {
    file.stem for file in Path(__file__).parent.glob("*.py")
}
FAILED: Final = "failed-test.txt"  # in the copy
EQUIVALENT: Final = Path(__file__).with_name("equivalent_mutants.toml")
Place = tuple[str, str]  # file in the package, qualified name of a function


class Recorder:
    """Plugin of pytest that records time and entered functions of each test."""

    def __init__(self, folder: str, out: str) -> None:
        self.folder, self.out = folder + "/", out
        self.seen: set[Place] = set()
        self.shared: set[Place] = set()  # entered by fixtures that several tests use, and by imports
        self.failed: set[str] = set()
        self.tests: dict[str, tuple[float, set[Place]]] = {}

    def call(self, frame: Any, _event: str, _argument: object) -> None:
        code = frame.f_code
        if code.co_filename.startswith(self.folder):
            function = code.co_qualname.partition(".<locals>")[0]
            self.seen.add((code.co_filename.removeprefix(self.folder), f"{function}()"))

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items[:] = [item for item in items if "program" not in item.fixturenames]  # that is compiled for minutes

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Generator[None, Any, Any]:
        self.seen, began = set(), time.perf_counter()
        sys.settrace(self.call)
        threading.settrace(self.call)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            threading.settrace(None)  # type: ignore[arg-type]
            self.tests[item.nodeid] = (time.perf_counter() - began, self.seen)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, Any, Any]:
        before, self.seen = self.seen, set()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                self.shared |= self.seen
            self.seen |= before

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        tests = {
            name: (seconds, sorted(seen | self.shared))
            for name, (seconds, seen) in self.tests.items()
            if name not in self.failed  # without a mutant, such as one that measures time
        }
        Path(self.out).write_text(json.dumps(tests), "utf-8")


def _fork(work: Callable[[], int], seconds: float) -> int | None:
    """Run a function in a forked process without output, and return its exit code.

    It is -SIGXCPU after ``seconds`` of processor time, and None after `PATIENCE` times as long on the clock.
    """
    child = os.fork()
    if child == 0:
        try:
            os.setsid()
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds)))
            for stream in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
            os._exit(work())
        finally:
            os._exit(98)
    end = time.monotonic() + PATIENCE * seconds
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            code = os.waitstatus_to_exitcode(status)
            return -signal.SIGXCPU if code == -signal.SIGKILL else code  # the hard limit of processor time
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


class Failure:
    """Plugin of pytest that writes the name of the first test that fails to a file."""

    def __init__(self, file: Path) -> None:
        self.file, self.found = file, False
        file.unlink(missing_ok=True)

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.failed and not self.found:
            self.found = True
            self.file.write_text(report.nodeid, "utf-8")


def run_tests(copy: Path, words: list[str], seconds: float, record: Path | None = None) -> int | None:
    """Run pytest in a forked process on the copy; return what `_fork` returns."""

    def work() -> int:
        os.chdir(copy)
        places = [str(copy / place) for place in ("python", ".", "tests/support")]
        sys.path[:0] = places
        os.environ["PYTHONPATH"] = os.pathsep.join(places)
        for name in [name for name in sys.modules if name.partition(".")[0] in OWN]:
            del sys.modules[name]
        sys.meta_path[:] = [one for one in sys.meta_path if "Redirecting" not in type(one).__name__]
        sys.dont_write_bytecode = True
        plugins = [Recorder(str(copy / PACKAGE), str(record)) if record else Failure(copy / FAILED)]
        options = ["-q" if record else "-x", "-p", "no:cacheprovider", f"--basetemp={copy / 'made'}"]
        code = int(pytest.main([*options, "--hypothesis-seed=1", *words], plugins=plugins))
        found = sys.modules.get("palpate")
        return code if found is None or str(found.__file__).startswith(str(copy)) else 99

    return _fork(work, seconds)


def copy_repository(target: Path) -> None:
    """Copy the tracked files, and the compiled core."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in names.split("\0"):
        if name and (ROOT / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    code = "import importlib.util as i; print(i.find_spec('palpate._core').origin)"
    core = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    shutil.copy2(core.strip(), target / PACKAGE)


def all_tests(copy: Path, records: Path, only: list[str], left_out: list[str]) -> dict[str, tuple[float, set[Place]]]:
    """Return time and entered functions of every test in a process; ``only`` those of some files, if any are given.

    Files without a record run once.
    """
    records.mkdir(parents=True, exist_ok=True)
    found: dict[str, tuple[float, set[Place]]] = {}
    for file in sorted((copy / "tests").rglob("test_*.py")):
        name = file.relative_to(copy / "tests")
        if name.parts[0] in SKIPPED or str(name) in left_out or (only and str(name) not in only):
            continue
        digest = hashlib.sha256(file.read_bytes()).hexdigest()[:16]
        record = records / f"{'.'.join(name.with_suffix('').parts)}.{digest}.json"
        if not record.exists():
            code = run_tests(copy, [f"tests/{name}"], 1200.0, record)
            if code not in (0, 1, 5):
                raise SystemExit(f"{name}: pytest ends with exit code {code} without a mutant")
            if code == 1:
                print(f"{name}: some tests fail without a mutant, and are left out", flush=True)
        for test, (seconds, seen) in json.loads(record.read_text("utf-8")).items():
            found[test] = (seconds, {(place, function) for place, function in seen})
    return found


def chosen(mutant: Mutant, tests: dict[str, Any], limit: float) -> list[list[str]]:
    """Return the tests that a mutant meets: those of the mirrored folder, then the others, fastest files first."""
    file = str(Path(mutant.file).relative_to(PACKAGE))
    places = {(file, function) for function in mutant.functions}
    folder = file.partition("/")[0].removesuffix(".py")
    mirrored = (f"tests/{folder}/", f"tests/test_{folder}.py")
    if not any(places & seen for _, seen in tests.values()):
        places = set()  # such as a function that the records do not know yet
    groups: list[list[str]] = [[], []]
    left = [limit, limit]
    for name, (seconds, seen) in sorted(tests.items(), key=lambda one: one[1][0]):
        group = 0 if name.startswith(mirrored) else 1
        entered = places & seen if places else any(one == file for one, _ in seen)
        if entered and left[group] > 0.0:
            groups[group].append(name)
            left[group] -= seconds
    for group in groups:
        total: Counter[str] = Counter()
        for name in group:
            total[name.partition("::")[0]] += tests[name][0]
        group.sort(key=lambda name: (total[name.partition("::")[0]], name.partition("::")[0]))
    return [group for group in groups if group]


def code_of(code: CodeType, names: list[str]) -> CodeType | None:
    """Return the code of a function inside the code of a module."""
    if not names:
        return code
    inner = [one for one in code.co_consts if isinstance(one, CodeType) and one.co_name == names[0]]
    return code_of(inner[0], names[1:]) if len(inner) == 1 else None


def replace_code(mutant: Mutant, changed: bytes) -> bool:
    """Give the live function its code in a changed file; return False if it cannot be done, or would change nothing."""
    if len(mutant.functions) != 1:
        return False
    names = mutant.functions[0].removesuffix("()").split(".")
    new = code_of(compile(changed, ROOT / mutant.file, "exec", dont_inherit=True), names)
    live: Any = sys.modules[".".join(Path(mutant.file).with_suffix("").parts[1:]).removesuffix(".__init__")]
    for name in names:
        live = vars(live).get(name)
    for inner in ("fget", "__func__", "func", "__wrapped__"):
        live = getattr(live, inner, live)
    old = getattr(live, "__code__", None)
    if new is None or old is None or (old.co_freevars, old.co_name) != (new.co_freevars, new.co_name) or old == new:
        return False
    live.__code__ = new
    return True


def makes_functions(mutant: Mutant, changed: bytes) -> bool:
    """Return whether the function of a mutant defines others, which may have been made before it was replaced."""
    names = mutant.functions[0].removesuffix("()").split(".")
    made = code_of(compile(changed, ROOT / mutant.file, "exec", dont_inherit=True), names)
    inner = [] if made is None else [one.co_name for one in made.co_consts if isinstance(one, CodeType)]
    return any(not name.startswith("<") or name == "<lambda>" for name in inner)


def run_items(copy: Path, items: list[pytest.Item], change: Callable[[], bool], seconds: float) -> int | None:
    """Run collected tests in a forked process after a change; return what `_fork` returns, 3 if nothing changes."""
    (copy / FAILED).unlink(missing_ok=True)

    def work() -> int:
        if not change():
            return 3
        failed, config = Failure(copy / FAILED), items[0].config
        config.pluginmanager.register(failed)
        for item, after in zip(items, [*items[1:], None], strict=True):
            config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            if failed.found:
                return 1
        return 0

    return _fork(work, seconds) if items else 3


def judge(copy: Path, mutant: Mutant, tests: dict[str, Any], items: dict[str, pytest.Item], limit: float) -> str:
    """Return how a mutant ends: "killed", "hang", "timeout", "survived", or "no test" if none enters its function."""
    groups = chosen(mutant, tests, limit)
    if not groups:
        return "no test"
    path = copy / mutant.file
    data = path.read_bytes()
    changed = data[: mutant.begin] + mutant.text.encode() + data[mutant.end :]
    result = "survived"
    for group in groups:
        seconds = 30.0 + 5.0 * sum(tests[name][0] for name in group)
        try:
            path.write_bytes(changed)
            live = [items[name] for name in group if name in items]
            code = run_items(copy, live, lambda: replace_code(mutant, changed), seconds)
            if code == 3 or (code == 0 and makes_functions(mutant, changed)):
                code = run_tests(copy, group, seconds)
        finally:
            path.write_bytes(data)
        if code == -signal.SIGXCPU:
            return "hang"
        if code is None:
            result = "timeout"
        elif code:
            failed = (copy / FAILED).read_text("utf-8") if (copy / FAILED).exists() else ""
            if failed in items and run_items(copy, [items[failed]], lambda: True, seconds) != 0:
                print(f"fails without a mutant: {failed}", flush=True)
                del tests[failed], items[failed]
                return judge(copy, mutant, tests, items, limit)
            return "killed"
    return result


def listed_as_equivalent() -> set[tuple[str, str, str, str]]:
    """Return file in the package, function, old and new lines of each mutant that is listed to change no result."""
    listed = tomllib.loads(EQUIVALENT.read_text("utf-8"))
    return {
        (file, one["function"], one["old"], one["new"])
        for file, entries in listed.items()
        for one in entries
        if one["reason"]
    }


def key_of(mutant: Mutant, data: bytes) -> tuple[str, str, str, str]:
    """Return the entry that lists a mutant of a file with these bytes; its lines are those before and after."""
    function = mutant.functions[0].removesuffix("()") if len(mutant.functions) == 1 else ""
    start, stop = data.rfind(b"\n", 0, mutant.begin) + 1, (data + b"\n").index(b"\n", mutant.end)
    changed = data[start : mutant.begin] + mutant.text.encode() + data[mutant.end : stop]
    old, new = (" ".join(lines.decode().split()) for lines in (data[start:stop], changed))
    return str(Path(mutant.file).relative_to(PACKAGE)), function, old, new


def summary(name: str, counts: Counter[str]) -> tuple[float, str]:
    """Return the share of the mutants that tests notice, among those that may change a result, and a sentence [%]."""
    noticed = counts["killed"] + counts["hang"]
    known = counts.total() - counts["timeout"]
    able = known - counts["equivalent"]
    raw, rate = (100.0 * noticed / max(1, total) for total in (known, able))
    rest = ", ".join(f"{count} {result}" for result, count in sorted(counts.items()) if result != "killed")
    equivalent = f"; {rate:.0f} % of the {able} not listed as equivalent" if counts["equivalent"] else ""
    return rate, f"{name}: {noticed} of {known} killed, {raw:.0f} %{equivalent}{f' ({rest})' if rest else ''}"


class Collected:
    """Plugin of pytest that does other work with the collected tests in place of running them."""

    def __init__(self, work: Callable[[dict[str, pytest.Item]], None]) -> None:
        self.work = work

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.work({item.nodeid: item for item in session.items})
        return True


def main() -> int:
    """Run the command line; return 1 if fewer mutants than required are killed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=3600.0, help="after which no other mutant begins")
    parser.add_argument(
        "--limit", type=float, default=60.0, help="seconds of tests of its folder, and of others, that a mutant meets"
    )
    parser.add_argument("--at", nargs="*", default=[], help="every mutant of these lines instead: units.py:40")
    parser.add_argument("--only", nargs="*", default=[], help="folders, or files, of the package: control units.py")
    parser.add_argument("--tests", nargs="*", default=[], help="only these files of tests: test_units.py")
    parser.add_argument(
        "--without", nargs="*", default=[], help="files of tests that take long: simulation/test_resolve.py"
    )
    parser.add_argument("--required", type=float, default=90.0, help="percent")
    given = parser.parse_args()
    os.nice(10)
    end, rng = time.monotonic() + given.seconds, random.Random(given.seed)
    for name in PRELOADED:
        if importlib.util.find_spec(name):
            importlib.import_module(name)
    files = [file.relative_to(ROOT) for file in sorted((ROOT / PACKAGE).rglob("*.py"))]
    only = {PACKAGE / one for one in given.only or ["."]}
    wanted = [file for file in files if only & {file, *file.parents}]
    results: dict[str, Counter[str]] = defaultdict(Counter)
    listed, wrong = listed_as_equivalent(), 0
    with TemporaryDirectory() as made:
        copy = Path(made).resolve()
        copy_repository(copy)
        tests = all_tests(copy, ROOT / "build" / "mutate", given.tests, given.without)
        pool = [mutant for file in wanted for mutant in mutants(copy / file, str(file))]
        sample = rng.sample(pool, min(given.count, len(pool)))
        if given.at:
            lines = {f"{PACKAGE / place}" for place in given.at}
            sample = [mutant for mutant in pool if f"{mutant.file}:{mutant.line}" in lines]

        def work(items: dict[str, pytest.Item]) -> None:
            nonlocal wrong
            for mutant in sample:
                if time.monotonic() > end:
                    break
                folder = Path(mutant.file).relative_to(PACKAGE).parts[0].removesuffix(".py")
                result = judge(copy, mutant, tests, items, given.limit)
                key = key_of(mutant, (copy / mutant.file).read_bytes())
                if key in listed and result in ("killed", "hang"):
                    wrong += 1
                    place = f"{mutant.file}:{mutant.line}"
                    print(f"listed as equivalent, but noticed: {place}: {key[2]} -> {key[3]}", flush=True)
                elif key in listed and result != "timeout":
                    result = "equivalent"
                results[folder][result] += 1
                print(f"{mutant.file}:{mutant.line} {result}", file=sys.__stderr__, flush=True)
                if result != "killed":
                    print(f"{result}: {mutant.file}:{mutant.line}: {key[1]}: {key[2]} -> {key[3]}", flush=True)

        files = sorted({name.partition("::")[0] for name in tests})
        options = ["-q", "-s", "-p", "no:cacheprovider", f"--basetemp={copy / 'made'}", "--hypothesis-seed=1"]
        pytest.main([*options, *files], plugins=[Collected(work)])
    for folder, counts in [*sorted(results.items()), ("all", sum(results.values(), Counter()))]:
        rate, sentence = summary(folder, counts)
        print(sentence)
    return 0 if rate >= given.required and not wrong else 1


if __name__ == "__main__":
    sys.exit(main())
