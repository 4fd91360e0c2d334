"""Everything that a certificate, a refusal and a yardstick promise, tried on random problems.

    uv run python benchmarks/audit.py [--what plans refusals advice smallest-dt price] [--count N] [--seed S]
        [--planners miqp ...] [--kinds flip ...] [--jobs 2] [--results FILE] [--save FOLDER]

`plans` plans each problem with each planner as the command line does, flies it, and tells what is left of
its certificate: attitude in gates, `always` conditions and limits in 10^5 samples, errors flown, durations
over those of time-optimal plans, times. `refusals` tries again what the MIQP refuses, with other N, orders
and durations and with free knots. `advice` follows what refusals advise. `smallest-dt` looks for shorter
plans than the MIQP's, 1 % at a time. `price` compares durations with those of an attitude in the gate that
is asked only in the plane of the turn, and of a passage at half the duration. Rows are appended to the
results' file; those that it holds are not measured again. Problems whose result is a defect are saved as
files.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # before NumPy starts its own

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from aerobat.planning import FreeKnots, GridSearch, Miqp, plan
from aerobat.planning.miqp.miqp import INTERVALS
from audit_advice import followed
from audit_measures import ALL_PLANNERS, Attempted, attempted, plan_facts, with_passage
from audit_tables import HARD, TABLES, defect
from hard_problems import hard_case
from random_problems import KINDS, Case, random_case, write_case

ASKED_INTERVALS = (10, 13, 16, 20, 20)  # of a MIQP that may refuse
RETRIED = (  # N and order, None what it takes by itself
    *((n, None) for n in (10, 13, 16, 20, 25, 30, 40)),
    *((n, order) for n in (14, 24) for order in (4, 5)),
)
FIXED_DURATIONS = np.geomspace(0.8, 10.0, 11)  # [s] tried with the intervals of RETRIED in turn
REFUSAL_PATIENCE = 30.0  # [s] of the processor, for one refusal
RETRY_PATIENCE = 8.0  # [s] likewise, for one of these
RETRIES_PATIENCE = 12.0  # [s] likewise, for all of these, in random order
SHORTER = (0.01, 0.02, 0.04, 0.07, 0.12, 0.2)  # of the duration
Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One measurement; its key tells it from all others."""

    what: str
    seed: int
    k: int
    kinds: tuple[str, ...]
    planner: str = ""

    @property
    def key(self) -> str:
        """Key of its row among the results."""
        return f"{self.what} {self.seed} {self.k} {','.join(self.kinds)} {self.planner}"

    @property
    def case(self) -> Case:
        """The problem and the vehicle."""
        if self.what in HARD:
            return hard_case(self.seed, self.k)
        return random_case(self.seed, self.k, self.kinds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--what", nargs="*", default=list(MEASURES), choices=list(MEASURES))
    parser.add_argument("--count", type=int, default=10, help="problems (10)")
    parser.add_argument("--first", type=int, default=0, help="the first of them (0)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--kinds", nargs="*", default=[], choices=list(KINDS), help="of these kinds only")
    parser.add_argument("--planners", nargs="*", default=ALL_PLANNERS, choices=ALL_PLANNERS)
    parser.add_argument("--jobs", type=int, default=2, help="processes (2)")
    parser.add_argument("--results", type=Path, default=Path("out/audit.jsonl"), help="out/audit.jsonl")
    parser.add_argument("--save", type=Path, default=Path("out/audit"), help="where problems go (out/audit)")
    options = parser.parse_args()
    options.results.parent.mkdir(parents=True, exist_ok=True)
    known = dict(read_rows(options.results))
    tasks = [task for what in options.what for task in tasks_of(what, options)]
    missing = [task for task in tasks if task.key not in known]
    with options.results.open("a") as file:
        for i, (task, row) in enumerate(measured(missing, options.jobs)):
            known[task.key] = row
            file.write(json.dumps({"key": task.key, **row}) + "\n")
            file.flush()
            complaint = defect(row)
            command = write_case(task.case, options.save, f"{task.seed}-{task.k}") if complaint else ""
            print(
                f"{i + 1}/{len(missing)} {task.key} {row['seconds']:.1f} s {complaint} {command}", flush=True
            )
    rows = [known[task.key] for task in tasks]
    for title, table in TABLES.items():
        if lines := list(table(rows)):
            print(f"\n{title}", *lines, sep="\n")


def tasks_of(what: str, options: argparse.Namespace) -> list[Task]:
    numbers, kinds = range(options.first, options.first + options.count), tuple(options.kinds)
    if what == "price" and not kinds:
        kinds = ("flip", "half-flip")
    names = options.planners if what == "plans" else [""]
    return [Task(what, options.seed, k, kinds, name) for k in numbers for name in names]


def read_rows(path: Path) -> Iterator[tuple[str, Row]]:
    if path.exists():
        for line in path.read_text().splitlines():
            row = json.loads(line)
            yield row["key"], row


def measured(tasks: list[Task], jobs: int) -> Iterator[tuple[Task, Row]]:
    if jobs == 1 or len(tasks) < 2:
        yield from map(measure, tasks)
        return
    with get_context("spawn").Pool(jobs) as pool:
        yield from pool.imap_unordered(measure, tasks)


def measure(task: Task) -> tuple[Task, Row]:
    case = task.case
    row = {"what": task.what, "seed": task.seed, "k": task.k, "kind": case.kind, "planner": task.planner}
    return task, row | {"case": case.problem.name} | MEASURES[task.what](task, case)


def plans(task: Task, case: Case) -> Row:
    return plan_facts(case.problem, case.vehicle, task.planner)


def refusals(task: Task, case: Case) -> Row:
    """A refusal by the MIQP of some N, and what plans the problem all the same."""
    row, made, _, rng = refused_perhaps(task, case)
    if row["status"] != "infeasible":
        return row | {"rescue": made.plan.rescue if made.plan else None}
    began = time.process_time()
    ways = {f"N = {n}, order {r or 'its own'}": Miqp(r, n, rescue=False) for n, r in RETRIED}
    for duration, n in zip(FIXED_DURATIONS.tolist(), cycle(sorted({n for n, _ in RETRIED})), strict=False):
        ways[f"{duration:.2f} s, N = {n}"] = at_duration(duration, n)
    planned, tried = "", 0
    for way in rng.permutation(list(ways)).tolist():
        if planned or time.process_time() - began > RETRIES_PATIENCE:
            break
        tried += 1
        planned = way if planned_by_miqp(case, ways[way]) else ""
    free = facts(attempted(partial(plan, case.problem, FreeKnots(), case.vehicle), RETRY_PATIENCE))
    free_knots = free["status"] == "planned" and free["certified"]
    return row | {"planned_by": planned, "tried": tried, "free_knots": free_knots}


def advice(task: Task, case: Case) -> Row:
    """A refusal by the MIQP of some N, and what comes of following its advice."""
    row, made, asked, _ = refused_perhaps(task, case)
    if made.plan is None and made.status in ("infeasible", "refused"):
        row["advice"] = followed(case, asked, made.message)
    return row


def refused_perhaps(task: Task, case: Case) -> tuple[Row, Attempted, Miqp, np.random.Generator]:
    """What the MIQP of some N makes of a hard problem; the N and the generator that drew it."""
    rng = np.random.default_rng([task.seed, task.k, 2])
    asked = Miqp(intervals=int(rng.choice(ASKED_INTERVALS)))
    made = attempted(partial(plan, case.problem, asked, case.vehicle), REFUSAL_PATIENCE)
    hardships = {"intervals": asked.intervals, "hardships": case.problem.description}
    return facts(made) | hardships, made, asked, rng


def at_duration(duration: float, intervals: int) -> Miqp:
    dt = duration / intervals
    return Miqp(intervals=intervals, search=GridSearch(dt, dt, 1), rescue=False)


def planned_by_miqp(case: Case, planner: Miqp) -> Row | None:
    made = attempted(partial(plan, case.problem, planner, case.vehicle), RETRY_PATIENCE)
    mine = made.plan is not None and made.plan.planner == "miqp" and made.plan.certified and made.plan.flies
    return facts(made) if mine else None


def smallest_dt(task: Task, case: Case) -> Row:
    """The MIQP's duration, and the shortest that it plans at a fixed dt below."""
    made = attempted(partial(plan, case.problem, Miqp(), case.vehicle))
    row = facts(made)
    if made.plan is None:
        return row
    shorter = []
    for fraction in SHORTER:
        wanted = made.plan.duration * (1.0 - fraction)
        found = planned_by_miqp(case, at_duration(wanted, INTERVALS))
        if found is not None and found["duration"] < made.plan.duration * (1.0 - SHORTER[0] / 2):
            shorter.append(found["duration"])
    return row | {"shorter": shorter}


def price(task: Task, case: Case) -> Row:
    """Durations of the MIQP's plans: as it stands, upright in the plane of the turn only, passed half-way."""
    row = facts(attempted(partial(plan, case.problem, Miqp(), case.vehicle)))
    for name, changes in (("in_plane", {"upright": False}), ("half_way", {"at": 0.5})):
        variant = with_passage(case.problem, **changes)
        row[name] = facts(attempted(partial(plan, variant, Miqp(), case.vehicle))).get("duration")
    return row


def facts(made: Attempted) -> Row:
    row: Row = {"status": made.status, "message": made.message, "seconds": made.seconds}
    if made.plan is not None:
        row |= {"duration": made.plan.duration, "certified": made.plan.certified}
    return row


MEASURES = {
    "plans": plans,
    "refusals": refusals,
    "advice": advice,
    "smallest-dt": smallest_dt,
    "price": price,
}

if __name__ == "__main__":
    main()
