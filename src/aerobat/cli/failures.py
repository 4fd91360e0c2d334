"""Failures of runs: one sentence each, and with --json the same as data."""

from __future__ import annotations

import json
import re
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum

from aerobat.cli.terminal import print_json, say
from aerobat.errors import AerobatError, BackendMissing, Infeasible, OwnCodeError, SpecError, chain_of

IMPORT_FLAG = "--import"
TRACEBACK_FLAG = "--traceback"

_FLAG = re.compile(r"(?<![\w-])--[a-z][\w-]*")


class ExitCode(IntEnum):
    """Outcome of a run, as an exit code for scripts."""

    WELL = 0
    NOT_WELL = 1  # not certified, or not flown as it should be
    BAD_INPUT = 2
    NO_PLAN = 3
    INTERRUPTED = 130  # as shells say it, and the next two
    BROKEN_PIPE = 141
    TERMINATED = 143


@dataclass(frozen=True)
class Failure:
    """The reason why a run failed."""

    kind: str  # bad_input, no_plan, missing_backend, plugin, interrupted or terminated
    message: str  # one sentence
    field: str | None = None  # the key or the option that is wrong, if any

    def tell(self, arguments: Sequence[str]) -> None:
        """Print the sentence to standard error and, with --json, the failure to standard output."""
        say(self.message)
        if "--json" in arguments:
            print_json(json.dumps({"error": asdict(self)}, indent=2, ensure_ascii=False))


def stopped_by(code: ExitCode) -> Failure:
    """Return the failure of a run that was interrupted or terminated by a signal."""
    name = code.name.lower()
    return Failure(name, name)


def foreseen(error: AerobatError) -> Failure:
    """Return the failure of a foreseen error."""
    if isinstance(error, Infeasible):
        sentence = error.with_remedy("add --explain to `aerobat plan` to try changes that would help")
        return Failure("no_plan", sentence, next(iter(error.limits), None))
    if isinstance(error, BackendMissing):
        return Failure("missing_backend", str(error))
    from aerobat.registry import placed

    return Failure("bad_input", str(placed(error) if isinstance(error, SpecError) else error), _field(error))


def of_plugins(error: BaseException, arguments: Sequence[str]) -> Failure | None:
    """Return the failure of a plugin that raised an unforeseen error; None where it is a defect of ours.

    The failure names the plugin's file and line where the error passed through one, in a worker's process
    too. Other errors may follow from a value that a plugin returned.

    Args:
        error: The error.
        arguments: The arguments of the command line.
    """
    from aerobat.registry import imported_plugins

    plugins = imported_plugins()
    if not plugins:
        return None
    everything = "".join(traceback.format_exception(error))
    lines = [f"{path}:{line}" for path, line in re.findall(r'File "(.+?)", line (\d+)', everything)]
    within = [line for line in lines if line.rpartition(":")[0] in plugins]
    is_ours = isinstance(error, OSError) or not any(each.startswith(IMPORT_FLAG) for each in arguments)
    if is_ours and not within:
        return None
    cause = error.__cause__ if isinstance(error, OwnCodeError) and error.__cause__ else error
    what = f"{type(cause).__name__}: {cause}" if str(cause) else type(cause).__name__
    place = within[-1] if within else f"with {', '.join(plugins)} imported"
    return Failure("plugin", f"{place}: {what}; {TRACEBACK_FLAG} shows the whole way there")


def _field(error: AerobatError) -> str | None:
    """Return the field that is wrong: the outermost name of it, or the option that the message names."""
    named = next((name for each in chain_of(error) if (name := getattr(each, "field", ""))), None)
    option = _FLAG.search(str(error))
    return named or (option and option[0]) or next(iter(error.limits), None)
