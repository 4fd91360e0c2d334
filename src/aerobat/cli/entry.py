"""The beginning and the end of a run: each way in which it can go has an exit code and a sentence.

Little is imported here, so that signals and broken terminals are provided for when the rest is.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence

from aerobat.cli.failures import TRACEBACK_FLAG, ExitCode, foreseen, of_plugins, stopped_by
from aerobat.cli.interrupts import REPORTED, interrupted_by, interruptible, is_interrupted
from aerobat.cli.terminal import discard, is_broken, provide_streams, say
from aerobat.errors import AerobatError, Infeasible, chain_of


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on `arguments`, by default those of the process.

    Whatever is foreseen ends in one sentence on standard error, and an exit code.
    """
    errors = sys.stderr
    tokens = sys.argv[1:] if arguments is None else arguments
    try:
        with interruptible(afterwards=arguments is not None):
            provide_streams()
            code = _run(tokens)
    except KeyboardInterrupt as interrupt:
        sys.stderr = errors or sys.stderr  # a solver may have been interrupted while it was led elsewhere
        code = interrupted_by()
        stopped_by(code).tell([] if REPORTED in interrupt.args else tokens)
    if code is not ExitCode.WELL:
        sys.exit(code)


def _run(arguments: Sequence[str]) -> ExitCode:
    """Run a command; a failure is told in a sentence."""
    # matrices are small: a pool of threads takes longer to begin than all of them
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(500_000, 10, 10)  # a short process need not look for cyclic garbage,
    atexit.register(gc.freeze)  # and least of all when it ends: a tenth of the main job
    try:
        from aerobat.cli.app import run

        code = run([token for token in arguments if token != TRACEBACK_FLAG])
        sys.stdout.flush()
    except AerobatError as error:
        foreseen(error).tell(arguments)
        return ExitCode.NO_PLAN if isinstance(error, Infeasible) else ExitCode.BAD_INPUT
    except (Exception, SystemExit) as error:
        return _unforeseen(error, arguments)
    return code


def _unforeseen(error: BaseException, arguments: Sequence[str]) -> ExitCode:
    """Say why a plugin failed, or what the operating system refused; raise what is a defect of ours."""
    if isinstance(error, SystemExit) and any(isinstance(each, BrokenPipeError) for each in chain_of(error)):
        return ExitCode.BROKEN_PIPE  # of rich's tables and help, for which it is no error of the system
    if isinstance(error, OSError) and error.filename is None and is_broken(sys.stdout):
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError):  # whoever read has enough
            return ExitCode.BROKEN_PIPE
        say(f"cannot write to standard output: {error.strerror or error}")
        return ExitCode.BAD_INPUT
    if is_interrupted():  # and what was raised was taken for another error
        raise error
    failure = None if TRACEBACK_FLAG in arguments else of_plugins(error, arguments)
    if failure is not None:
        failure.tell(arguments)
        return ExitCode.BAD_INPUT
    if not isinstance(error, OSError) or error.filename is not None:  # of a file, which is nobody's but ours
        raise error
    say(f"the operating system refused: {error.strerror or error}")
    return ExitCode.BAD_INPUT
