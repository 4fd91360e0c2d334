"""The beginning and the end of a run: each way in which it can go has an exit code and a sentence.

Little is imported here, so that Ctrl-C and broken terminals are provided for when the rest is.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from aerobat.cli.exit_code import ExitCode
from aerobat.cli.interrupts import interruptible
from aerobat.cli.terminal import discard, is_broken, provide_streams, say
from aerobat.errors import AerobatError, Infeasible

EXPLAIN = "add --explain to `aerobat plan` to try changes that would help"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on `arguments`, by default those of the process.

    Whatever is foreseen ends in one sentence on standard error, and an exit code.
    """
    code, errors = ExitCode.INTERRUPTED, sys.stderr
    try:
        with interruptible(afterwards=arguments is not None):
            provide_streams()
            code = _run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        sys.stderr = errors or sys.stderr  # a solver may have been interrupted while it was led elsewhere
        say("interrupted")
    if code is not ExitCode.WELL:
        sys.exit(code)


def _run(arguments: Sequence[str]) -> ExitCode:
    """Run a command, and say in a sentence why where it comes to no end of its own."""
    # matrices are small: a pool of threads takes longer to begin than all of them
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(500_000, 10, 10)  # a short process need not look for cyclic garbage,
    atexit.register(gc.freeze)  # and least of all when it ends: a tenth of the main job
    try:
        from aerobat.cli.app import run

        code = run(arguments)
        sys.stdout.flush()
    except Infeasible as error:
        say(error.with_remedy(EXPLAIN))
        return ExitCode.NO_PLAN
    except AerobatError as error:
        say(str(error))
        return ExitCode.BAD_INPUT
    except OSError as error:
        return _of_the_system(error)
    return code


def _of_the_system(error: OSError) -> ExitCode:
    """Say what the operating system refused; one who reads no further has enough."""
    if error.filename is not None:  # of a file, which is nobody's fault but ours
        raise error
    reason = error.strerror or error
    if is_broken(sys.stdout):
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError):
            return ExitCode.BROKEN_PIPE
        say(f"cannot write to standard output: {reason}")
    else:
        say(f"the operating system refused: {reason}")
    return ExitCode.BAD_INPUT
