"""Mutation testing of the rooms in rooms.toml: change the code by one operator or number, and see a test fail.

    uv run --group mutation python mutation/mutate.py [ROOM ...] [--sample 100] [--seed 0]

cosmic-ray changes files in place, so that it works on a copy of the tree. A sample is drawn at random, the
same for the same seed. Survivors are printed as what they change.
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
from typing import Any

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome, WorkResult

ROOT = Path(__file__).parents[1]
CPU_LIMIT = 90  # [s] of a run of a room's tests: an endless loop is a mutant killed
# what is neither a type error at once nor the same: of each operator its opposite and its neighbours
OPERATORS = re.compile(
    r"core/(NumberReplacer|ReplaceTrueWithFalse|ReplaceFalseWithTrue|ReplaceAndWithOr|ReplaceOrWithAnd"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak|ZeroIterationForLoop|AddNot"
    r"|ReplaceUnaryOperator_Delete_\w+"
    r"|ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|FloorDiv_Mul|Mod_Mul|BitOr_BitAnd|BitAnd_BitOr)"
    r"|ReplaceComparisonOperator_(Lt_LtE|Lt_GtE|LtE_Lt|LtE_Gt|Gt_GtE|Gt_LtE|GtE_Gt|GtE_Lt|Eq_NotEq|NotEq_Eq"
    r"|Is_IsNot|IsNot_Is))"
)


@dataclass(frozen=True)
class Room:
    """Modules, and the tests that concern them."""

    name: str
    modules: list[str]
    tests: list[str]
    without: list[str]

    def config(self, tree: Path) -> Path:
        """Write cosmic-ray's file of settings into a copy of the tree."""
        chosen = f"not ({' or '.join(self.without)})" if self.without else ""
        pytest = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-p",
            "no:cacheprovider",
            *self.tests,
            "-k",
            f"'{chosen}'",
        ]
        command = f'sh -c \\"ulimit -t {CPU_LIMIT}; exec {" ".join(pytest)}\\"'
        path = tree / f"{self.name}.toml"
        path.write_text(
            f"[cosmic-ray]\nmodule-path = {self.modules}\ntimeout = {10.0 * CPU_LIMIT}\nexcluded-modules = []\n"
            f'test-command = "{command}"\n[cosmic-ray.distributor]\nname = "local"\n'
        )
        return path


def main() -> None:
    """Mutate each room, print its numbers and its survivors."""
    rooms = {name: Room(name, **{"without": [], **keys}) for name, keys in _rooms().items()}
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("rooms", nargs="*", choices=[[], *rooms], help="all unless named")
    parser.add_argument("--sample", type=int, default=100, help="mutants of a room, at most")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        tree = _copy(Path(folder))
        for name in asked.rooms or rooms:
            _mutate(rooms[name], tree, asked.sample, asked.seed)


def _rooms() -> dict[str, Any]:
    return tomllib.loads((ROOT / "mutation" / "rooms.toml").read_text(encoding="utf-8"))


def _copy(folder: Path) -> Path:
    """What git knows and does not ignore, as it stands."""
    listed = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    for name in subprocess.run(
        listed, cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines():
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def _mutate(room: Room, tree: Path, count: int, seed: int) -> None:
    config, session = room.config(tree), tree / f"{room.name}.sqlite"
    environment = {
        **os.environ,
        "PYTHONPATH": str(tree / "src"),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }

    def run(*arguments: str | Path) -> None:
        program = Path(sys.executable).with_name("cosmic-ray")
        subprocess.run([program, *arguments], cwd=tree, env=environment, check=True)

    run("init", config, session)
    with use_db(session) as db:
        total = _sample(db, tree, count, seed)
    run("baseline", config)
    run("exec", config, session)
    with use_db(session) as db:
        _report(room, db, total)


def _sample(db: WorkDB, tree: Path, count: int, seed: int) -> int:
    """Skip all but so many mutants that are worth a run; return how many these are drawn from."""
    items = sorted(db.work_items, key=lambda item: _place(item.mutations[0]))
    annotations = {
        path: _annotations(tree / path) for path in {item.mutations[0].module_path for item in items}
    }
    worthy = [
        item.job_id
        for item in items
        if OPERATORS.fullmatch(item.mutations[0].operator_name)
        and not _within(item.mutations[0], annotations[item.mutations[0].module_path])
    ]
    random.Random(seed).shuffle(worthy)
    drawn = set(worthy[:count])
    rest = {item.job_id for item in items} - drawn
    db.set_multiple_results(rest, WorkResult(WorkerOutcome.SKIPPED))
    return len(worthy)


def _place(mutation: MutationSpec) -> tuple[str, tuple[int, int], str, int]:
    return str(mutation.module_path), mutation.start_pos, mutation.operator_name, mutation.occurrence


def _annotations(path: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where types stand, which are never run."""
    spans = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for name in ("annotation", "returns"):
            part = getattr(node, name, None)
            if isinstance(part, ast.expr):
                end = part.end_lineno or part.lineno, part.end_col_offset or 0
                spans.append(((part.lineno, part.col_offset), end))
    return spans


def _within(mutation: MutationSpec, spans: list[tuple[tuple[int, int], tuple[int, int]]]) -> bool:
    return any(start <= mutation.start_pos < end for start, end in spans)


def _report(room: Room, db: WorkDB, total: int) -> None:
    done = [(item, result) for item, result in db.completed_work_items if result.diff is not None]
    survivors = [(item, result) for item, result in done if result.test_outcome is TestOutcome.SURVIVED]
    print(
        f"{room.name}: {len(done)} of {total} mutants tried, {len(done) - len(survivors)} killed", flush=True
    )
    for item, result in sorted(survivors, key=lambda pair: _place(pair[0].mutations[0])):
        mutation = item.mutations[0]
        changed = [line for line in (result.diff or "").splitlines() if re.match(r"[-+](?![-+])", line)]
        print(f"{mutation.module_path}:{mutation.start_pos[0]} in {mutation.definition_name}")
        print("\n".join(f"    {line}" for line in changed), flush=True)


if __name__ == "__main__":
    main()
