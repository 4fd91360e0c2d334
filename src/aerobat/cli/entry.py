"""The beginning and the end of a run: every outcome has an exit code, and every failure a sentence.

Few modules are imported here, so that signals and broken terminals are handled while the others are imported.
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

    A foreseen failure ends in one sentence on standard error, and an exit code.
    """
    errors = sys.stderr
    tokens = sys.argv[1:] if arguments is None else arguments
    try:
        with interruptible(afterwards=arguments is not None):
            provide_streams()
            code = _run(tokens)
    except KeyboardInterrupt as interrupt:
        sys.stderr = errors or sys.stderr  # an interrupted solver may have redirected it
        code = interrupted_by()
        stopped_by(code).tell([] if REPORTED in interrupt.args else tokens)
    if code is not ExitCode.WELL:
        sys.exit(code)


def _run(arguments: Sequence[str]) -> ExitCode:
    """Run a command, report its failure in a sentence, and return the exit code."""
    # matrices are small: starting a pool of threads takes longer than all of their algebra
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(500_000, 10, 10)  # a short process need not collect cyclic garbage,
    atexit.register(gc.freeze)  # least of all at its end, which saves a tenth of the main job
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
    """Report the failure of a plugin or of the operating system; raise an error that is a defect of ours."""
    if isinstance(error, SystemExit) and any(isinstance(each, BrokenPipeError) for each in chain_of(error)):
        return ExitCode.BROKEN_PIPE  # rich exits where its pipe is broken
    if isinstance(error, OSError) and error.filename is None and is_broken(sys.stdout):
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError):  # the reader has closed the pipe
            return ExitCode.BROKEN_PIPE
        say(f"cannot write to standard output: {error.strerror or error}")
        return ExitCode.BAD_INPUT
    if is_interrupted():  # the interrupt was turned into another error
        raise error
    failure = None if TRACEBACK_FLAG in arguments else of_plugins(error, arguments)
    if failure is not None:
        failure.tell(arguments)
        return ExitCode.BAD_INPUT
    if not isinstance(error, OSError) or error.filename is not None:  # about a file: a defect of ours
        raise error
    say(f"the operating system refused: {error.strerror or error}")
    return ExitCode.BAD_INPUT
