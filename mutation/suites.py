"""Mutants that the default suite kills, beside those that the full one kills.

    uv run --group mutation python mutation/suites.py [--sample 100] [--seed 0] [--workers 2]

Mutants are drawn at random over what moves, maps, proves and judges: kernels, flatness, certification and the
judge of plans. Of either suite the tests of those rooms are run that run the mutated one, the nearest first.
Groups that need another program, or start processes, are left out of both.
"""

from __future__ import annotations

import argparse
import os
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from queue import Queue

from cosmic_ray.commands import init
from cosmic_ray.mutating import use_mutation
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import MutationSpec
from mutate import ROOT, copied_tree, worthy

PACKAGE = Path("src") / "aerobat"
MODULES = (
    PACKAGE / "kernels",
    PACKAGE / "flatness",
    PACKAGE / "certification",
    PACKAGE / "planning" / "flyability.py",
    PACKAGE / "planning" / "passages.py",
    PACKAGE / "planning" / "certified_solve.py",
    PACKAGE / "planning" / "rotor_margin.py",
    PACKAGE / "planning" / "assessment",
)
# by the room of a mutant, the rooms whose tests are run, those that look most closely at it first
ROOMS = {
    "kernels": ("kernels", "flatness", "control", "estimation", "engines", "simulation", "evaluation"),
    "flatness": ("flatness", "kernels", "certification", "simulation"),
    "certification": ("certification", "flatness", "planning"),
    "planning": ("planning", "evaluation"),
}
APART = "browser or ros or docs or process or peer or betaflight"
LEFT_OUT = {"default": f"slow or {APART}", "full": APART}
CPU_LIMIT = 600  # [s] of a run: an endless loop is a mutant killed


def main() -> None:
    """Try the mutants, print what became of each, and the ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sample", type=int, default=100, help="mutants, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2, help="mutants that are tried at once")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(asked.workers) as pool:
        drawn = mutants(Path(folder))
        random.Random(asked.seed).shuffle(drawn)
        trees: Queue[Path] = Queue()
        for k in range(asked.workers):
            trees.put(copied_tree(Path(folder) / f"tree-{k}"))
        if not passes(
            "default", [f"tests/{room}" for room in sorted({*chain(*ROOMS.values())})], trees.queue[0]
        ):
            raise SystemExit("the default suite fails without a mutant; mend that first")
        found = pool.map(lambda mutant: tried(mutant, trees), drawn[: asked.sample])
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


def tried(mutant: MutationSpec, trees: Queue[Path]) -> str:
    """Return the suite that kills a mutant, or "nobody"; nothing where the code did not change."""
    module, line = mutant.module_path.relative_to(ROOT), mutant.start_pos[0]
    tests, tree = [f"tests/{room}" for room in ROOMS[module.parts[2]]], trees.get()
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
    if done.returncode not in (0, 1) and done.returncode > 0:
        print(done.stdout[-500:], done.stderr[-500:], file=sys.stderr, flush=True)
    return done.returncode == 0


if __name__ == "__main__":
    main()
