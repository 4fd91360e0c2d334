"""The command line: its commands, help, and exit codes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

from cyclopts import App, CycloptsError, Group, MissingArgumentError, Parameter, UnusedCliTokensError

from aerobat.cli.failures import IMPORT_FLAG, ExitCode
from aerobat.errors import SpecError

# each command is a function in a file of the same name, imported when the command is run;
# the commands of `link` are two to a file
COMMANDS: dict[str, dict[str, str | dict[str, str]]] = {
    "Plan and fly": {
        "fly": "Plan a maneuver, fly it in simulation, and report.",
        "plan": "Plan a maneuver and stop there.",
        "compare": "Plan a maneuver with every planner and put the plans side by side.",
        "repeat": "Repeat a saved run and compare the results.",
    },
    "Study": {
        "check": "Prove that a vehicle can fly a trajectory, or say when and why it cannot.",
        "sweep": "Fly a maneuver many times under random conditions and report success rates.",
        "causes": "Measure how much each of four error sources degrades a flight.",
        "tune": "Find controller gains for a vehicle over many flights, and write them to its file.",
        "feasibility": "Find the least that a maneuver needs, or map feasibility over two parameters.",
    },
    "Look": {
        "view": "Replay a run, a plan or a flight in a browser, or serve a page with sliders.",
        "inspect": "Find the cause of a recorded flight's error.",
    },
    "Connect": {
        "export": "Write a plan for another system, and report what is lost.",
        "link": {
            "mavlink": "Fly a plan on an autopilot over MAVLink.",
            "mavlink-vehicle": "Simulate a vehicle that MAVLink clients can fly.",
            "ros": "Fly maneuvers on demand as a node of ROS 1 or 2: services in, goals out.",
            "ros-vehicle": "Simulate a vehicle that is a node of ROS 1 or 2.",
        },
    },
    "Files": {
        "show": "List the built-in problems and vehicles, describe one, or write its file.",
    },
}

app = App(
    name="aerobat",
    help="""Plan, fly and prove aggressive maneuvers for multirotors.

    Try `aerobat fly flip-roll`: it plans a flip through a gate, flies it in simulation, says whether it
    went well and why not, and writes the plan, the flight, a picture and a report to out/flip-roll/.
    """,
    help_epilogue="""Exit codes: 0 all is well; 1 not certified, or not flown as it should be (off its
    path, past a gate, into its frame or the ground, or so in more than 5 of 100 flights): all is written, and
    the report says why; 2 the input is
    wrong or the output cannot be written (one sentence says where); 3 no plan was found (one sentence says
    which bound binds, and with --explain another which changes would help); 130 interrupted; 143
    terminated; then with nothing written. A sweep that was flown ends with 0, whatever became of its flights;
    a sweep or a map that was interrupted keeps what is finished, and the same command goes on there. With
    --json an error is {"error": {"kind", "message", "field"}} on standard output. --traceback shows where a
    plugin fails.
    """,
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=""),  # without a --no-OPTION or --empty-OPTION for each OPTION
)
for title, commands in COMMANDS.items():
    group = Group.create_ordered(title)
    for name, help in commands.items():
        if isinstance(help, str):
            app.command(f"aerobat.cli.commands.{name}:{name}", name=name, help=help, group=group)
            continue
        summary = "Fly by MAVLink or ROS, or simulate a vehicle for either."
        inner = App(name=name, help=summary, group=group)
        app.command(inner)
        for each, its_help in help.items():
            file, place = each.partition("-")[0], each.replace("-", "_")
            inner.command(f"aerobat.cli.commands.{file}:{place}", name=each, help=its_help)


START = """Plan, fly and prove aggressive maneuvers for multirotors. To begin with, type:
  aerobat fly flip-roll        plan a flip, fly it in simulation, and report; results go to out/flip-roll/
  aerobat show                 list the maneuvers and the vehicles
  aerobat --help               list all commands"""


def run(arguments: Sequence[str]) -> ExitCode:
    """Run the command that `arguments` name. Raises SpecError for wrong arguments."""
    if not arguments:
        print(START)
        return ExitCode.WELL
    try:
        _import_plugins(arguments)
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        raise SpecError(_sentence(error)) from None
    return code if isinstance(code, ExitCode) else ExitCode.WELL  # help and some commands return none


def _sentence(error: CycloptsError) -> str:
    """Return what is wrong with arguments, and what to type instead."""
    command = " ".join(("aerobat", *(error.command_chain or ())))
    if isinstance(error, UnusedCliTokensError):
        unused = " ".join(error.unused_tokens or ())
        return f"`{command}` has no use for '{unused}'; leave it out, or see `{command} --help`"
    if isinstance(error, MissingArgumentError) and error.argument is not None:
        missing = error.argument.name
        if error.keyword:
            missing = f"a value after {error.keyword}"
        elif error.argument.field_info.is_positional:
            missing = f"a {missing.strip('-').upper()}"
        return f"`{command}` needs {missing}; see `{command} --help`"
    return " ".join(str(error).split())


def _import_plugins(tokens: Sequence[str]) -> None:
    """Run the Python files that `--import` names, which register maneuvers and planners.

    The planners add options of their own, so the files run before the options are read.
    """
    for path in _import_paths(tokens):
        from aerobat.registry import import_plugin

        import_plugin(path)


def _import_paths(tokens: Sequence[str]) -> Iterator[str]:
    for token, following in pairwise((*tokens, "")):
        if token == IMPORT_FLAG and following:
            yield following
        elif token.startswith(f"{IMPORT_FLAG}="):
            yield token.removeprefix(f"{IMPORT_FLAG}=")
