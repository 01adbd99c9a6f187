"""Measure which mistakes in the C++ core the tests notice: `python tests/support/core_mutate.py`.

The headers of a copy in build/core-mutants contain all mistakes of `core_mutants.py`, each behind a number that a
program reads when it starts. So the GoogleTests and the Python module compile once, without sanitizers; a mistake that
does not compile ends the run. First each test runs alone without a mutant: it must pass, and its record contains its
time and the mutants that it evaluates. Then each mutant meets the GoogleTests that evaluate it, fastest first. If it
survives, it meets the files of Python tests of its folder that evaluate it. A mutant that no test evaluates survives.
Tests that use five times their processor time and 5 s more count as "hang", which is a kill; those that merely wait
longer count as "timeout", which is no kill. One process runs at low priority.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Final

from core_mutants import CORE_MUTANTS

ROOT: Final = Path(__file__).parents[2]
BUILD: Final = ROOT / "build" / "core-mutants"
COPY: Final = BUILD / "source"
MADE: Final = BUILD / "made"
HEADERS: Final = "core/include/palpate"
GOOGLE_TESTS: Final = {
    "plant": "plant/plant_integrator servo/simulation",
    "servo": "servo/fault_guard servo/stability_monitor servo/simulation servo/servo servo/servo_guard servo/batch",
    "mesh": "mesh/friction_cone mesh/proxy_laws mesh/proxy_closed_form mesh/mesh_updater mesh/proxy_random",
    "deformable": "deformable/contact/contact_lcp deformable/contact/layer_friction deformable/linear/modal "
    "deformable/linear/viscoelastic_solid deformable/contact/tip_contact deformable/contact/partial_slip "
    "deformable/multirate/local_model deformable/multirate/passive_model_switch "
    "deformable/contact/signed_distance_contact "
    "deformable/contact/partial_slip_models deformable/contact/layer_point",
}  # files of the tests of each folder of headers, quick ones first
PYTHON_TESTS: Final = {
    "plant": "devices simulation/test_simulate.py simulation/test_loop.py simulation/test_jitter.py "
    "simulation/test_batch.py",
    "servo": "simulation/test_simulate.py simulation/test_loop.py simulation/test_jitter.py simulation/test_batch.py "
    "simulation/test_normalized_controller.py simulation/test_guards.py sweeps/test_sweeps.py sweeps/test_agreement.py",
    "mesh": "contact simulation/test_mesh_object.py simulation/test_scenes.py stability/test_mesh_certificate.py",
    "deformable": "fem/test_body_contact.py fem/test_body_friction.py fem/test_linear_models.py "
    "fem/test_curved_bodies.py fem/test_contact_dynamics.py "
    "fem/test_signed_distance.py fem/test_hyperelastic.py fem/test_quasi_static.py "
    "fem/test_deep_indentation.py fem/test_mass_spring.py simulation/test_body_object.py "
    "simulation/test_hyperelastic_object.py simulation/test_body_response.py",
}  # files, and folders of files, of the tests of each folder of headers
# Fail in the copy without a mutant: the first compiles the source without mutant.hpp; the second compares two
# translation units within 1e-9 N, which -O1 rounds differently.
LEFT_OUT: Final = (
    "tests/simulation/test_batch.py::test_wide_code_stays_in_its_own_file",
    "tests/simulation/test_hyperelastic_object.py::test_the_loop_feels_what_the_body_answers",
)
SWITCH: Final = """#pragma once
#include <cstdio>
#include <cstdlib>
struct PalpateMutants {
  int on = std::getenv("PALPATE_MUTANT") ? std::atoi(std::getenv("PALPATE_MUTANT")) : 0;
  bool reached[1000] = {};
  ~PalpateMutants() {
    const char* const name = std::getenv("PALPATE_REACHED");
    std::FILE* const file = name ? std::fopen(name, "a") : nullptr;
    if (!file) return;
    for (int i = 0; i < 1000; ++i)
      if (reached[i]) std::fprintf(file, "%d\\n", i);
    std::fclose(file);
  }
};
inline PalpateMutants palpate_mutants;
[[gnu::always_inline]] inline bool palpate_mutant(int number) {
  palpate_mutants.reached[number] = true;
  return palpate_mutants.on == number;
}
"""
PROJECT: Final = """cmake_minimum_required(VERSION 3.22)
project(core_mutants CXX)
set(CMAKE_CXX_FLAGS "-w -include ${CMAKE_CURRENT_SOURCE_DIR}/mutant.hpp")
add_subdirectory(source)
set(CMAKE_CXX_FLAGS "-w")
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_EXTENSIONS OFF)
find_package(GTest REQUIRED)
foreach(test ${TESTS})
  string(REPLACE "/" "_" name ${test})
  add_executable(${name} source/core/tests/${test}_test.cpp)
  target_link_libraries(${name} PRIVATE palpate GTest::gtest_main)
  target_include_directories(${name} PRIVATE source/core/tests)
  target_compile_options(${name} PRIVATE -UNDEBUG -Wno-psabi)
  if(first)
    target_precompile_headers(${name} REUSE_FROM ${first})
  else()
    target_precompile_headers(${name} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/mutant.hpp <gtest/gtest.h> <Eigen/Dense>)
    set(first ${name})
  endif()
endforeach()
"""  # one program per file of tests
PATIENCE: Final = 8.0  # time on the clock over processor time of one run of tests
QUICK: Final = 0.1  # s, of a GoogleTest that runs before the slower ones
Records = dict[str, tuple[float, list[int]]]  # processor time of each test, and the mutants that it evaluates


def put(path: Path, data: bytes) -> None:
    """Write a file unless it has this content, so that only what changes compiles again."""
    if not path.exists() or path.read_bytes() != data:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def prepare() -> None:
    """Write the copy of the tracked files, with all mutants."""
    texts: dict[str, str] = {}
    for number, mutant in enumerate(CORE_MUTANTS, 1):
        header = f"{HEADERS}/{mutant.header}"
        text = texts.setdefault(header, (ROOT / header).read_text("utf-8"))
        if text.count(mutant.old) != 1:
            raise SystemExit(f"{header} contains {text.count(mutant.old)} times: {mutant.old}")
        texts[header] = text.replace(mutant.old, mutant.switched(number))
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in names.split("\0"):
        if (ROOT / name).is_file():
            put(COPY / name, texts[name].encode() if name in texts else (ROOT / name).read_bytes())
    put(BUILD / "mutant.hpp", SWITCH.encode())
    put(BUILD / "CMakeLists.txt", PROJECT.encode())


def compile_copy(targets: list[str], jobs: int) -> None:
    """Compile programs of tests, or the Python module `_core`."""
    programs = {name: shutil.which(name) or str(Path(sys.executable).parent / name) for name in ("cmake", "ninja")}
    tests = sorted({test for files in GOOGLE_TESTS.values() for test in files.split()})
    options = [
        f"-DTESTS={';'.join(tests)}", f"-DPALPATE_PYTHON={'ON' if '_core' in targets else 'OFF'}",
        "-DPALPATE_NATIVE_LANES=ON", "-DCMAKE_BUILD_TYPE=Mutants", "-DCMAKE_CXX_FLAGS_MUTANTS=-O1 -DNDEBUG",
        f"-DPython_EXECUTABLE={sys.executable}", f"-DCMAKE_MAKE_PROGRAM={programs['ninja']}",
    ]  # fmt: skip
    for command in (
        [programs["cmake"], "-S", str(BUILD), "-B", str(MADE), "-G", "Ninja", *options],
        [programs["ninja"], "-C", str(MADE), f"-j{jobs}", "-k0", *targets],
    ):
        if subprocess.run(command, check=False).returncode:
            raise SystemExit(f"build failed: {' '.join(command)}")
    for module in MADE.rglob("_core*.so") if "_core" in targets else ():
        put(COPY / "python" / "palpate" / module.name, module.read_bytes())


def run(command: list[str], mutant: int, seconds: float, reached: Path | None = None) -> str:
    """Return how a command ends with a mutant: "passed", "failed", "hang" or "timeout"."""

    def limit() -> None:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds)))

    places = os.pathsep.join(str(COPY / one) for one in ("python", ".", "tests/support"))
    environment = os.environ | {"PALPATE_MUTANT": str(mutant), "PYTHONPATH": places, "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        command,
        cwd=COPY,
        env=environment | ({"PALPATE_REACHED": str(reached)} if reached else {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        preexec_fn=limit,  # noqa: PLW1509 - one thread
    )
    try:
        said, _ = process.communicate(timeout=PATIENCE * seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return "timeout"
    if process.returncode in (-signal.SIGKILL, -signal.SIGXCPU):
        return "hang"
    if process.returncode and not mutant:
        print(said[-3000:])
    return "failed" if process.returncode else "passed"


def processor_time() -> float:
    """Return the processor time of all processes that have ended, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def record(name: str, command: list[str], records: Records) -> bool:
    """Run a test without a mutant, and record its time and the mutants that it evaluates; return whether it passes."""
    file = BUILD / "reached"
    file.unlink(missing_ok=True)
    began = processor_time()
    passed = run(command, 0, 1200.0, file) == "passed"
    if passed:
        numbers = {int(one) for one in file.read_text("utf-8").split()} if file.exists() else set()
        records[name] = (processor_time() - began, sorted(numbers))
    return passed


def google_tests(program: Path) -> Records:
    """Return the records of a program of GoogleTests. Raise SystemExit if a test fails without a mutant."""
    kept = BUILD / f"{program.name}.{hashlib.sha256(program.read_bytes()).hexdigest()[:16]}.json"
    if kept.exists():
        return {name: (seconds, reached) for name, (seconds, reached) in json.loads(kept.read_text("utf-8")).items()}
    listed = subprocess.run([program, "--gtest_list_tests"], capture_output=True, text=True, check=True).stdout
    records: Records = {}
    suite = ""
    for line in listed.splitlines():
        word = line.split("#")[0].strip()
        if not line.startswith(" "):
            suite = word if word.endswith(".") else suite
        elif not record(suite + word, [str(program), f"--gtest_filter={suite + word}", "--gtest_brief=1"], records):
            raise SystemExit(f"fails without a mutant: {suite + word}")
    put(kept, json.dumps(records).encode())
    return records


def python_tests(folder: str, records: Records) -> Records:
    """Return the records of the files of Python tests of a folder. A file that fails without a mutant is left out."""
    found: Records = {}
    for name in PYTHON_TESTS[folder].split():
        place = COPY / "tests" / name
        for file in sorted(place.glob("test_*.py")) if place.is_dir() else [place]:
            key = str(file.relative_to(COPY))
            if key not in records and not record(key, pytest_command([key]), records):
                print(f"fails without a mutant, left out: {key}", flush=True)
                records[key] = (0.0, [])
            found[key] = records[key]
    return found


def pytest_command(files: list[str]) -> list[str]:
    """Return the command that runs files of Python tests until one fails."""
    options = ["-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=1", *(f"--deselect={one}" for one in LEFT_OUT)]
    return [sys.executable, "-m", "pytest", *options, *files]


def meet_google(number: int, program: Path, records: Records) -> str:
    """Return how the GoogleTests of a program end that evaluate a mutant: those that are quick first."""
    for quick in (True, False):
        tests = {
            name: seconds
            for name, (seconds, reached) in records.items()
            if number in reached and (seconds < QUICK) == quick
        }
        if tests:
            options = [f"--gtest_filter={':'.join(tests)}", "--gtest_fail_fast", "--gtest_brief=1"]
            end = run([str(program), *options], number, 5.0 + 5.0 * sum(tests.values()))
            if end != "passed":
                return end
    return "passed"


def programs_of(folder: str) -> list[str]:
    """Return the programs of GoogleTests of a folder of headers."""
    return [test.replace("/", "_") for test in GOOGLE_TESTS[folder].split()]


def judge_google(number: int, programs: dict[str, Records]) -> str:
    """Return how a mutant ends among the GoogleTests: "killed", "hang", "timeout", "survived" or "no test"."""
    names = programs_of(CORE_MUTANTS[number - 1].header.partition("/")[0])
    if not any(number in reached for name in names for _, reached in programs[name].values()):
        return "no test"
    for name in names:
        end = meet_google(number, MADE / name, programs[name])
        if end != "passed":
            return "killed" if end == "failed" else end
    return "survived"


def judge_python(number: int, records: Records, slow: float) -> str:
    """Return how a mutant ends among the files of Python tests that take less than ``slow`` seconds."""
    files = {name: seconds for name, (seconds, reached) in records.items() if number in reached and seconds < slow}
    for name, seconds in sorted(files.items(), key=lambda one: one[1]):
        end = run(pytest_command([name]), number, 5.0 + 5.0 * seconds)
        if end != "passed":
            return "killed" if end == "failed" else end
    return "survived" if files else "no test"


def summary(google: dict[int, str], python: dict[int, str]) -> tuple[float, float]:
    """Print the rates of each folder; return the rates of all by GoogleTest alone and by both, percent."""
    folders: dict[str, list[int]] = defaultdict(list)
    for number in google:
        folders[CORE_MUTANTS[number - 1].header.partition("/")[0]].append(number)
    rates = (0.0, 0.0)
    for folder, numbers in [*sorted(folders.items()), ("all", list(google))]:
        dead = [number for number in numbers if google[number] in ("killed", "hang")]
        both = [number for number in numbers if number in dead or python.get(number) in ("killed", "hang")]
        rates = (100.0 * len(dead) / len(numbers), 100.0 * len(both) / len(numbers))
        counts = dict(Counter(python.get(number, google[number]) for number in numbers))
        print(
            f"{folder}: of {len(numbers)}, GoogleTest alone kills {len(dead)}, {rates[0]:.1f} %; with Python "
            f"{len(both)}, {rates[1]:.1f} %; {counts}"
        )
    return rates


def main() -> int:
    """Run the command line; return 1 if fewer mutants than required are killed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--jobs", type=int, default=1, help="of the compiler")
    parser.add_argument("--only", type=int, nargs="*", help="numbers of mutants")
    parser.add_argument("--folders", nargs="*", default=[*GOOGLE_TESTS], help="of headers")
    parser.add_argument("--no-python", action="store_true", help="GoogleTests only")
    parser.add_argument("--slow", type=float, default=60.0, help="seconds of a file of Python tests that is left out")
    parser.add_argument("--required-google", type=float, default=85.0, help="percent by GoogleTest alone")
    parser.add_argument("--required", type=float, default=95.0, help="percent by either")
    given = parser.parse_args()
    os.nice(10)
    numbers = [
        number
        for number, mutant in enumerate(CORE_MUTANTS, 1)
        if mutant.header.partition("/")[0] in given.folders and (not given.only or number in given.only)
    ]
    prepare()
    used = {CORE_MUTANTS[number - 1].header.partition("/")[0] for number in numbers}
    names = sorted({name for folder in used for name in programs_of(folder)})
    compile_copy(names if given.no_python else [*names, "_core"], given.jobs)
    programs = {name: google_tests(MADE / name) for name in names}
    google: dict[int, str] = {}
    for number in numbers:
        began = time.monotonic()
        google[number] = judge_google(number, programs)
        mutant = CORE_MUTANTS[number - 1]
        print(
            f"{number} {google[number]} ({time.monotonic() - began:.1f} s): {mutant.header}: {mutant.old!r} -> "
            f"{mutant.new!r}",
            flush=True,
        )
    python: dict[int, str] = {}
    left = [number for number in numbers if google[number] not in ("killed", "hang")]
    if left and not given.no_python:
        records: Records = {}
        for number in left:
            folder = CORE_MUTANTS[number - 1].header.partition("/")[0]
            python[number] = judge_python(number, python_tests(folder, records), given.slow)
            print(f"{number} Python: {python[number]}", flush=True)
    alone, both = summary(google, python)
    return 0 if alone >= given.required_google and (given.no_python or both >= given.required) else 1


if __name__ == "__main__":
    sys.exit(main())
