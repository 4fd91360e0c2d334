"""The command line: which commands there are, and how each run ends."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Iterator, Sequence

from cyclopts import App, CycloptsError

from aerobat.errors import AerobatError, Infeasible

BAD_INPUT = 2
INFEASIBLE = 3
INTERRUPTED = 130
BROKEN_PIPE = 141  # as shells say it
IMPORT_FLAG = "--import"

# each is one file and one function of this name, imported when it is asked for
COMMANDS = {
    "fly": "Plan a maneuver, fly it in simulation, and report.",
    "plan": "Plan a maneuver and stop there.",
    "check": "Prove that a vehicle can fly a trajectory, or say when and why it cannot.",
    "compare": "Plan a maneuver with every planner and put the plans side by side.",
    "vehicles": "List the built-in vehicles.",
    "problems": "List the built-in problems.",
}

app = App(
    name="aerobat",
    help="""Plan, fly and prove aggressive maneuvers for multirotors.

    Try `aerobat fly flip-roll`: it plans a flip through a gate, flies it in simulation, says whether it
    went well and why not, and writes the plan, the flight, a picture and a report to out/flip-roll/.
    """,
    help_epilogue="""Exit codes: 0 done; 1 `check` did not certify the trajectory; 2 the input is wrong (one
    sentence says where); 3 no plan exists (one sentence says which bound binds and what would free it).
    """,
)
for name, help in COMMANDS.items():
    app.command(f"aerobat.cli.{name}:{name}", name=name, help=help)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on `arguments`, by default those of the process.

    Whatever is foreseen ends in one sentence on standard error, and an exit code.
    """
    gc.set_threshold(100_000, 50, 50)  # a short process need not look for cyclic garbage often,
    atexit.register(gc.freeze)  # and least of all when it ends: a tenth of the main job
    tokens = sys.argv[1:] if arguments is None else arguments
    try:
        _import_plugins(tokens)
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(BROKEN_PIPE)
    except CycloptsError as error:
        _exit(" ".join(str(error).split()), BAD_INPUT)
    except Infeasible as error:
        _exit(str(error), INFEASIBLE)
    except AerobatError as error:
        _exit(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        _exit("interrupted", INTERRUPTED)


def _import_plugins(tokens: Sequence[str]) -> None:
    """Run the Python files that `--import` names, which register maneuvers and planners.

    Their planners bring options of their own: this comes before the options are read.
    """
    for path in _import_paths(tokens):
        from aerobat.declaration import import_plugin

        import_plugin(path)


def _import_paths(tokens: Sequence[str]) -> Iterator[str]:
    for token, following in zip(tokens, [*tokens[1:], ""], strict=True):
        if token == IMPORT_FLAG and following:
            yield following
        elif token.startswith(f"{IMPORT_FLAG}="):
            yield token.removeprefix(f"{IMPORT_FLAG}=")


def _exit(sentence: str, code: int) -> None:
    print(f"aerobat: {sentence}", file=sys.stderr)
    sys.exit(code)
