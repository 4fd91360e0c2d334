"""Mutants that the default suite kills, beside those that the full one kills.

    uv run --group mutation python mutation/suites.py [--sample 100] [--seed 0] [--workers 2] [--traced FILE]

Mutants are drawn at random over what moves, maps, proves and judges: kernels, flatness, certification and the
judge of plans. Of either suite those tests are run that reach the mutated line, as a traced run of the full
suite says (`--traced`, a data file of coverage with contexts; without it that run comes first). Of kernels,
which engines trace once and keep, all tests of the rooms that run them. Browser, ROS, documentation and
processes of their own are left out of both: no line of theirs is traced.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue

from cosmic_ray.commands import init
from cosmic_ray.mutating import use_mutation
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import MutationSpec
from coverage import CoverageData
from mutate import ROOT, copied_tree, worthy

PACKAGE = Path("src") / "aerobat"
KERNELS = PACKAGE / "kernels"
MODULES = (
    KERNELS,
    PACKAGE / "flatness",
    PACKAGE / "certification",
    PACKAGE / "planning" / "flyability.py",
    PACKAGE / "planning" / "passages.py",
    PACKAGE / "planning" / "certified_solve.py",
    PACKAGE / "planning" / "rotor_margin.py",
    PACKAGE / "planning" / "assessment",
)
# the rooms whose tests run kernels, those that look most closely at one first
ROOMS = ("kernels", "flatness", "vehicle", "control", "estimation", "engines", "simulation", "evaluation")
UNTRACED = "browser or ros or docs or process"
LEFT_OUT = {"default": f"slow or peer or {UNTRACED}", "full": UNTRACED}
CPU_LIMIT = 600  # [s] of a run: an endless loop is a mutant killed


def main() -> None:
    """Try the mutants, print what became of each, and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sample", type=int, default=100, help="mutants, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2, help="mutants that are tried at once")
    parser.add_argument("--traced", type=Path, help="data of a traced run of the full suite")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(asked.workers) as pool:
        drawn = mutants(Path(folder))
        random.Random(asked.seed).shuffle(drawn)
        reach = Reach(asked.traced or traced(Path(folder)))
        trees: Queue[Path] = Queue()
        for k in range(asked.workers):
            trees.put(copied_tree(Path(folder) / f"tree-{k}"))
        found = pool.map(lambda mutant: tried(mutant, reach, trees), drawn[: asked.sample])
        killers = [killer for killer in found if killer]
    by_default, by_full = killers.count("default"), sum(killer != "nobody" for killer in killers)
    print(f"{len(killers)} of {len(drawn)} mutants tried; killed by the full suite {by_full}, ", end="")
    print(f"by the default suite {by_default}: {by_default / max(by_full, 1):.2f} of these")


def mutants(folder: Path) -> list[MutationSpec]:
    """Return the mutants that are worth a run, in a fixed order."""
    places = [ROOT / module for module in MODULES]
    paths = [path for place in places for path in (place.rglob("*.py") if place.is_dir() else [place])]
    with use_db(folder / "mutants.sqlite") as db:
        init(paths, db, {})
        return [mutant for mutant, _ in worthy(db, ROOT)]


def traced(folder: Path) -> Path:
    """Run the full suite, traced; return the data file."""
    data = folder / "traced"
    command = [
        "pytest",
        "--full",
        "-m",
        f"not ({UNTRACED})",
        "--cov=aerobat",
        "--cov-context=test",
        "--cov-report=",
    ]
    environment = {**os.environ, "COVERAGE_FILE": str(data)}
    subprocess.run([sys.executable, "-m", *command], cwd=ROOT, env=environment, check=True)
    return data


class Reach:
    """The tests that reach a line."""

    def __init__(self, path: Path) -> None:
        self._data = CoverageData(str(path))
        self._data.read()
        self._files = {Path(name).as_posix(): name for name in self._data.measured_files()}

    def tests(self, module: Path, line: int) -> list[str]:
        """Return the test functions, or rooms, that may notice a change of a line; the nearest first."""
        if KERNELS in module.parents:
            return [f"tests/{room}" for room in ROOMS]
        (name,) = (one for posix, one in self._files.items() if posix.endswith(module.as_posix()))
        contexts = self._data.contexts_by_lineno(name)
        reached = {_function(context) for context in contexts.get(line, ()) if context}
        if not reached:  # it is run at import, for all that the module does
            reached = {_function(one) for line in contexts.values() for one in line if one}
        return sorted(reached, key=lambda test: (_room(test) != module.parts[2], test))


def _function(context: str) -> str:
    return re.sub(r"(\[.*)?\|\w+$", "", context)


def _room(test: str) -> str:
    return test.split("/")[1]


def tried(mutant: MutationSpec, reach: Reach, trees: Queue[Path]) -> str:
    """Return the suite that kills a mutant, or "nobody"; nothing where the code did not change."""
    module, line = mutant.module_path.relative_to(ROOT), mutant.start_pos[0]
    tests, tree = reach.tests(module, line), trees.get()
    operator = get_operator(mutant.operator_name)()
    try:
        with use_mutation(tree / module, operator, mutant.occurrence) as (before, after):
            if after is None or before == after:
                return ""
            found = next((suite for suite in LEFT_OUT if not passes(suite, tests, tree)), "nobody")
    finally:
        trees.put(tree)
    print(f"{found:8s} {module}:{line}  {after.splitlines()[line - 1].strip()}", flush=True)
    return found


def passes(suite: str, tests: list[str], tree: Path) -> bool:
    """Return True where a suite's tests pass in a tree."""
    full = ["--full"] if suite == "full" else []
    pytest = [sys.executable, "-m", "pytest", "-x", "-n", "0", "-p", "no:cacheprovider", "--no-budget", *full]
    command = [*pytest, "-m", f"not ({LEFT_OUT[suite]})", *tests]
    own = {"PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    limited = ["sh", "-c", f'ulimit -t {CPU_LIMIT}; exec "$@"', "sh", *command]
    done = subprocess.run(limited, cwd=tree, env={**os.environ, **own}, capture_output=True, text=True)
    if done.returncode == 5:  # no test of this suite reaches the line
        return True
    if done.returncode not in (0, 1) and done.returncode > 0:
        print(done.stdout[-500:], done.stderr[-500:], file=sys.stderr, flush=True)
    return done.returncode == 0


if __name__ == "__main__":
    main()
