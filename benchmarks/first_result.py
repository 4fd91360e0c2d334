"""How long commands take against importing NumPy, SciPy's optimizers and Matplotlib, fresh processes in turn.

The main job, the plan alone and the help; with compiled bytecode, as from the second run on, and without any,
as on the very first. Medians of RUNS after a warm-up, of the clock and of the processor (user and system);
those of the processor count where something else runs on the machine. Of another checkout, where one is
given, the same in the same turns.

uv run python benchmarks/first_result.py [RUNS] [ANOTHER CHECKOUT]
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

HERE = Path(__file__).parents[1]
IMPORTS = "import numpy, scipy.optimize, matplotlib"
REFERENCES = {
    "python -c pass": ["-c", "pass"],
    "import numpy": ["-c", "import numpy"],
    IMPORTS: ["-c", IMPORTS],
}
COMMANDS = {  # with what is asked of each: at most so many times the imports
    "aerobat fly flip-roll": ("fly flip-roll", "1.8"),
    "aerobat plan flip-roll": ("plan flip-roll", "1.3"),
    "aerobat --help": ("--help", ""),
}
MODULES = "import sys; from aerobat.cli import main; main(sys.argv[1:]); print(*sys.modules, file=sys.stderr)"
IMPORT_ALL = """
from importlib import import_module
for name in {names!r}:
    try:
        import_module(name)
    except ImportError:  # made by another one, not imported
        pass
"""

Seconds = tuple[float, float]  # of the clock, of the processor


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 9
    checkouts = [HERE, *(Path(each).resolve() for each in sys.argv[2:])]
    with tempfile.TemporaryDirectory() as folder:
        bytecode = {"PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode"), "PYTHONDONTWRITEBYTECODE": ""}
        none = {"PYTHONPYCACHEPREFIX": folder, "PYTHONDONTWRITEBYTECODE": "1"}
        for label, variables in (("compiled bytecode", bytecode), ("no bytecode", none)):
            report(label, measured(checkouts, folder, variables, runs), checkouts)


def measured(
    checkouts: Sequence[Path], folder: str, variables: Mapping[str, str], runs: int
) -> dict[tuple[str, Path | None], Seconds]:
    """The medians of all commands, in turn."""
    jobs: dict[tuple[str, Path | None], list[str]] = {(name, None): job for name, job in REFERENCES.items()}
    for checkout in checkouts:
        for name, (words, _) in COMMANDS.items():
            jobs[name, checkout] = ["-m", "aerobat", *words.split()]
        jobs["what plan imports", checkout] = ["-c", imports_of("plan flip-roll", checkout, folder)]
    taken: dict[tuple[str, Path | None], list[Seconds]] = {key: [] for key in jobs}
    for _ in range(runs + 1):
        for key, arguments in jobs.items():
            taken[key].append(seconds(arguments, environment(key[1], variables), folder))
    return {key: median(each[1:]) for key, each in taken.items()}


def report(label: str, taken: Mapping[tuple[str, Path | None], Seconds], checkouts: Sequence[Path]) -> None:
    wall, processor = taken[IMPORTS, None]
    print(f"{label:44}  clock s  processor s  over the imports (processor)  asked")
    for name in REFERENCES:
        print(f"  {name:42}  {taken[name, None][0]:7.2f}  {taken[name, None][1]:11.2f}")
    for k, checkout in enumerate(checkouts):
        for name in [*COMMANDS, "what plan imports"]:
            own = taken[name, checkout]
            ratios = f"{own[0] / wall:16.2f} ({own[1] / processor:.2f})"
            where = "" if len(checkouts) == 1 else " (other)" if k else " (this)"
            asked = COMMANDS[name][1] if name in COMMANDS else ""
            print(f"  {name + where:42}  {own[0]:7.2f}  {own[1]:11.2f}  {ratios:28}  {asked}")
        plan, modules = taken["aerobat plan flip-roll", checkout], taken["what plan imports", checkout]
        print(f"    plan over what it imports: {plan[0] / modules[0]:.2f} ({plan[1] / modules[1]:.2f})")
        late = taken["aerobat --help", checkout][0] - taken["python -c pass", None][0]
        numpy = taken["import numpy", None][0] - taken["python -c pass", None][0]
        print(f"    --help after python -c pass: {late:.2f} s, NumPy takes {numpy:.2f} (asked: 0.25 at 0.1)")


def imports_of(words: str, checkout: Path, folder: str) -> str:
    """A program that imports what a command does, and no more."""
    ran = subprocess.run(
        [sys.executable, "-c", MODULES, *words.split()],
        cwd=folder, env=environment(checkout, {}), check=True, capture_output=True, text=True,
    )  # fmt: skip
    names = [name for name in ran.stderr.split() if not name.startswith("__")]
    return IMPORT_ALL.format(names=names)


def environment(checkout: Path | None, variables: Mapping[str, str]) -> dict[str, str]:
    path = {} if checkout is None else {"PYTHONPATH": str(checkout / "src")}
    return {**os.environ, **path, **variables}


def seconds(arguments: Sequence[str], variables: Mapping[str, str], folder: str) -> Seconds:
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, *arguments], cwd=folder, env=variables, stdout=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, arguments)
    return time.perf_counter() - began, used.ru_utime + used.ru_stime


def median(taken: Sequence[Seconds]) -> Seconds:
    clock, processor = zip(*taken, strict=True)
    return statistics.median(clock), statistics.median(processor)


if __name__ == "__main__":
    main()
