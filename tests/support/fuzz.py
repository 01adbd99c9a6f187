"""Fuzz every reader: `python tests/support/fuzz.py --count 1000 --seed 1 --out build/fuzz`.

A case is a valid file with random changes. It passes if it is read, or refused by a PalpateError. A child process runs
the cases; one that crashes, computes longer than 5 s or needs more than 1 GB is recorded, and the next child goes on.
The child reads HDF5 without the process that tries a file first, which would take half a second for each case. A case
that breaks the child is run once more with it, and counts as "contained" if that process keeps palpate from harm.
Each failing file is kept under --out; move it to tests/corpus/READER/ together with the fix.
"""

from __future__ import annotations

import argparse
import faulthandler
import multiprocessing
import os
import random
import resource
import sys
import time
import traceback
import warnings
from collections import Counter
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parent))

import palpate.files.hdf5_input
from palpate.errors import PalpateError
from readers import Reader, readers

LIMIT_SECONDS: Final = 20.0  # of computing; four times as long on the clock, because the machine is shared
LIMIT_MEMORY: Final = 1_000_000  # kB
SHARES: Final = {"scenario": 8, "device": 8, "csv": 6, "units": 6, "mesh": 6}  # of the cases; the others have 1


def run_case(reader: Reader, path: Path, seed: str) -> str:
    """Run one case; return "read", "refused", or the traceback of any other exception."""
    rng = random.Random(seed)
    name, data = rng.choice(reader.seeds)
    file = path / name
    reader.mutate(data, file, rng)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader.use(file)
    except PalpateError:
        return "refused"
    except (Exception, SystemExit):
        return traceback.format_exc()
    return "read"


def _child(seed: int, first: int, count: int, now: Synchronized[int], found: Any) -> None:
    faulthandler.disable()
    palpate.files.hdf5_input._try_in_process = lambda *_args: None  # the child stands for that process
    with TemporaryDirectory() as folder:
        (Path(folder) / "seeds").mkdir()
        (Path(folder) / "case").mkdir()
        all_readers = readers(Path(folder) / "seeds")
        names = [name for name in all_readers for _ in range(SHARES.get(name, 1))]
        for index in range(first, count):
            name = names[index % len(names)]
            found.put((index, name, "begin"))
            now.value = index
            began = time.process_time()
            result = run_case(all_readers[name], Path(folder) / "case", f"{seed} {index}")
            if time.process_time() - began > LIMIT_SECONDS:
                result = "slow"
            elif resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > LIMIT_MEMORY:
                found.put((index, name, "memory"))
                break
            found.put((index, name, result))
            for file in (Path(folder) / "case").iterdir():
                file.unlink()
        now.value = count if index == count - 1 else index + 1


def _contained(seed: int, index: int, name: str) -> bool:
    """Return whether a case passes in a new child that reads HDF5 as palpate does."""

    def again() -> None:
        with TemporaryDirectory() as folder:
            (Path(folder) / "seeds").mkdir()
            (Path(folder) / "case").mkdir()
            reader = readers(Path(folder) / "seeds")[name]
            before = resource.getrusage(resource.RUSAGE_SELF)
            result = run_case(reader, Path(folder) / "case", f"{seed} {index}")
            after = resource.getrusage(resource.RUSAGE_SELF)
        slow = after.ru_utime - before.ru_utime > LIMIT_SECONDS
        os._exit(0 if result in ("read", "refused") and not slow and after.ru_maxrss < LIMIT_MEMORY else 1)

    child = multiprocessing.get_context("fork").Process(target=again)
    child.start()
    child.join(20 * LIMIT_SECONDS)
    if child.is_alive():
        child.kill()
    child.join()
    return child.exitcode == 0


def fuzz(count: int, seed: int, seconds: float) -> tuple[Counter[tuple[str, str]], list[tuple[int, str, str]]]:
    """Run cases 0 to `count` - 1; return the number of each result by reader, and the failures."""
    context = multiprocessing.get_context("fork")
    results: Counter[tuple[str, str]] = Counter()
    failures: list[tuple[int, str, str]] = []
    first, end = 0, time.monotonic() + seconds
    while first < count and time.monotonic() < end:
        now, found = context.Value("q", first), context.Queue()
        child = context.Process(target=_child, args=(seed, first, count, now, found))
        child.start()
        state, since = (first, "", "begin"), time.monotonic()
        while time.monotonic() < end:
            try:
                state = found.get(timeout=0.2)
            except Exception:
                if not child.is_alive():
                    break
                if state[2] == "begin" and state[1] and time.monotonic() - since > 4 * LIMIT_SECONDS:
                    child.kill()
                continue
            since = time.monotonic()
            index, name, result = state
            if result != "begin":
                kind = result if result in ("read", "refused", "memory", "slow") else "traceback"
                results[name, kind] += 1
                if kind in ("memory", "slow") and _contained(seed, index, name):
                    results[name, kind] -= 1
                    results[name, "contained"] += 1
                elif kind not in ("read", "refused"):
                    failures.append((index, name, result))
                first = index + 1
        if child.is_alive():
            child.kill()
        child.join()
        if state[2] == "begin" and state[1] and child.exitcode and time.monotonic() < end:
            kind = "hang" if child.exitcode == -9 else f"crash {child.exitcode}"
            contained = _contained(seed, state[0], state[1])
            results[state[1], "contained" if contained else kind] += 1
            if not contained:
                failures.append((state[0], state[1], kind))
            first = state[0] + 1
    return results, failures


def keep(seed: int, index: int, name: str, folder: Path) -> Path:
    """Write the file of a case again."""
    with TemporaryDirectory() as made:
        reader = readers(Path(made))[name]
        rng = random.Random(f"{seed} {index}")
        file, data = rng.choice(reader.seeds)
        target = folder / name / f"{seed}-{index}-{file}"
        target.parent.mkdir(parents=True, exist_ok=True)
        reader.mutate(data, target, rng)
    return target


def main() -> int:
    """Run the command line; return 1 if a case failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"))
    given = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    results, failures = fuzz(given.count, given.seed, given.seconds)
    for name in dict.fromkeys(reader for reader, _ in sorted(results)):
        print(f"{name}: " + ", ".join(f"{n} {kind}" for (reader, kind), n in sorted(results.items()) if reader == name))
    seen: set[str] = set()
    for index, name, reason in failures:
        last = reason.strip().splitlines()[-1]
        if last not in seen:
            seen.add(last)
            print(f"\n{name}, case {index}: {reason}\nkept: {keep(given.seed, index, name, given.out)}")
    print(f"{sum(results.values())} cases, {len(failures)} failures, seed {given.seed}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
