"""Mutation testing of the rooms in rooms.toml: one operator or number changed, a test must fail.

    uv run --group mutation python mutation/mutate.py [ROOM ...] [--sample 100] [--seed 0]

cosmic-ray changes files in place, so that it works on a copy of the tree. A sample is drawn at random, the
same for the same seed. Survivors are printed as what they change. Types, decorators and `strict=` are left as
they are: what they change is not run, only speed, or only a guard.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

import tomli_w
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome, WorkResult

ROOT = Path(__file__).parents[1]
CPU_LIMIT = 90  # [s] of a run of a room's tests: an endless loop is a mutant killed
# of each operator its opposite and its neighbours: what is neither a type error at once nor the same
OPERATORS = re.compile(
    r"core/(NumberReplacer|ReplaceTrueWithFalse|ReplaceFalseWithTrue|ReplaceAndWithOr|ReplaceOrWithAnd"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop|AddNot"
    r"|ReplaceUnaryOperator_Delete_\w+"
    r"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|FloorDiv_Mul|Mod_Mul)"
    r"|ReplaceBinaryOperator_(BitOr_BitAnd|BitAnd_BitOr)"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt)"
    r"|ReplaceComparisonOperator_(Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is))"
)
Place = tuple[int, int]  # line and column


@dataclass(frozen=True)
class Room:
    """Modules, and the tests that concern them."""

    name: str
    modules: list[str]
    tests: list[str]
    without: list[str]  # words in the names of tests that are left out

    def config(self, tree: Path) -> Path:
        """Write cosmic-ray's settings into a copy of the tree."""
        chosen = f"not ({' or '.join(self.without)})" if self.without else ""
        pytest = f"{sys.executable} -m pytest -x -p no:cacheprovider {' '.join(self.tests)} -k '{chosen}'"
        settings = {
            "module-path": self.modules,
            "timeout": 10.0 * CPU_LIMIT,
            "excluded-modules": [],
            "test-command": f'sh -c "ulimit -t {CPU_LIMIT}; exec {pytest}"',
            "distributor": {"name": "local"},
        }
        path = tree / f"{self.name}.toml"
        path.write_text(tomli_w.dumps({"cosmic-ray": settings}), encoding="utf-8")
        return path


def main() -> None:
    """Mutate each room, print its numbers and its survivors."""
    tables = tomllib.loads((ROOT / "mutation" / "rooms.toml").read_text(encoding="utf-8"))
    rooms = {name: Room(name, **{"without": [], **keys}) for name, keys in tables.items()}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=f"{', '.join(rooms)}; all unless named")
    parser.add_argument("--sample", type=int, default=100, help="mutants of a room, at most")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tree = copied_tree(Path(folder))
        for name in asked.rooms or rooms:
            _mutate(rooms[name], tree, asked.sample, asked.seed)


def copied_tree(folder: Path) -> Path:
    """Copy what git knows and does not ignore, as it stands, to a folder."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def _mutate(room: Room, tree: Path, count: int, seed: int) -> None:
    config, session = room.config(tree), tree / f"{room.name}.sqlite"
    own = {"PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

    def run(*arguments: str | Path) -> None:
        program = Path(sys.executable).with_name("cosmic-ray")
        subprocess.run([program, *arguments], cwd=tree, env={**os.environ, **own}, check=True)

    run("init", config, session)
    with use_db(session) as db:
        total = _sample(db, tree, count, seed)
    run("baseline", config)
    run("exec", config, session)
    with use_db(session) as db:
        _report(room, db, total)


def worthy(db: WorkDB, tree: Path) -> list[tuple[MutationSpec, str]]:
    """Return the mutations that are worth a run, each with its job, in a fixed order."""
    mutations = sorted(((item.mutations[0], item.job_id) for item in db.work_items), key=_place_of)
    spans = {path: _left_alone(tree / path) for path in {one.module_path for one, _ in mutations}}
    return [
        (one, job)
        for one, job in mutations
        if OPERATORS.fullmatch(one.operator_name)
        and not any(start <= one.start_pos < end for start, end in spans[one.module_path])
    ]


def _sample(db: WorkDB, tree: Path, count: int, seed: int) -> int:
    """Skip all but so many mutants that are worth a run; return how many these are drawn from."""
    jobs = [job for _, job in worthy(db, tree)]
    random.Random(seed).shuffle(jobs)
    rest = {item.job_id for item in db.work_items} - set(jobs[:count])
    db.set_multiple_results(rest, WorkResult(WorkerOutcome.SKIPPED))
    return len(jobs)


def _place_of(mutation: tuple[MutationSpec, str]) -> tuple[str, Place, str, int]:
    """What to sort by; the identifiers of jobs are random."""
    one = mutation[0]
    return str(one.module_path), one.start_pos, one.operator_name, one.occurrence


def _left_alone(path: Path) -> list[tuple[Place, Place]]:
    """Return where types, decorators and `strict=` stand."""
    spans = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None)]
        parts += getattr(node, "decorator_list", [])
        if isinstance(node, ast.keyword) and node.arg == "strict":
            parts.append(node.value)
        for part in parts:
            if isinstance(part, ast.expr):
                end = part.end_lineno or part.lineno, part.end_col_offset or 0
                spans.append(((part.lineno, part.col_offset), end))
    return spans


def _report(room: Room, db: WorkDB, total: int) -> None:
    tried = [(item.mutations[0], result) for item, result in db.completed_work_items if result.diff]
    survivors = [
        (one, result.diff or "") for one, result in tried if result.test_outcome is TestOutcome.SURVIVED
    ]
    killed = len(tried) - len(survivors)
    print(f"{room.name}: {len(tried)} of {total} mutants tried, {killed} killed", flush=True)
    for one, diff in sorted(survivors, key=lambda pair: _place_of((pair[0], ""))):
        print(f"{one.module_path}:{one.start_pos[0]} in {one.definition_name}")
        for line in diff.splitlines():
            if re.match(r"[-+](?![-+])", line):
                print(f"    {line}", flush=True)


if __name__ == "__main__":
    main()
