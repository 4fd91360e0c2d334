"""Whatever goes wrong ends in one sentence and an exit code; with --json in data too."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aerobat.cli.commands import fly as fly_command
from command_lines import run, without_pictures
from shared_plans import shared_plan

MANEUVER = """
import aerobat as ab
from aerobat.problem import Stage, StageSequence

@ab.maneuver("{name}")
class Mine(ab.Maneuver):
    height: float = 1.0

    def stage_sequence(self, gates, max_specific_thrust):
        {body}
"""
PLANNER = """
import aerobat as ab

@ab.planner("{name}")
class Mine(ab.Planner):
    def plan(self, problem, vehicle=None, progress=None):
        {body}
"""
PLANT = """
import aerobat as ab
from aerobat.simulation.plants import PLANTS, Plant

class Mine(Plant):
    def begin(self, scene, motion):
        {body}

PLANTS.add("{name}", Mine)
"""
LAW = """
import aerobat as ab
from aerobat.kernels.rigid_body import RotorWrench

@ab.controller("{name}")
class Mine(ab.ControlLaw):
    {field}

    def init(self, ops, model, seen):
        {init}

    def step(self, ops, model, state, seen, elapsed):
        {step}
"""
HOVER = "return state, RotorWrench(9.81 * model.airframe.mass_properties.mass, (0.0, 0.0, 0.0))"
PROBLEM = """
start.position = [0.0, 0.0, 1.0]
goal.position = [1.0, 0.0, 1.0]
maneuver.kind = "{name}"
"""
# what stands in the plugin, and what the sentence says of it; those of a line of its own name that
IN_A_LINE = {
    "gates[7]": "IndexError: tuple index out of range",
    'raise KeyError("thrust")': "KeyError: 'thrust'",
    "return 1 / 0": "ZeroDivisionError: division by zero",
    "return undefined": "NameError: name 'undefined' is not defined",
    "return self.stage_sequence(gates, max_specific_thrust)": "RecursionError: maximum recursion depth",
    "assert max_specific_thrust < 0": "AssertionError",
    "import no_such_module": "ModuleNotFoundError: No module named 'no_such_module'",
    "raise SystemExit(0)": "SystemExit: 0",
    'open("nowhere.csv")': "FileNotFoundError: [Errno 2] No such file or directory: 'nowhere.csv'",
    "return StageSequence((Stage(),))": None,  # ours says which key is missing
    'return StageSequence((Stage("a", conditions=(3,)),))': None,
    "return None": "not a StageSequence",
    "return [1, 2]": "not a StageSequence",
}
IN_A_PLAN = {
    "return 42": "returned 42 from plan(), not a Plan",
    "pass": "returned None from plan(), not a Plan",
    "return vehicle.no_such_field": "AttributeError: 'Vehicle' object has no attribute 'no_such_field'",
    'raise ValueError("no convergence")': "ValueError: no convergence",
    "return ab.Plan(problem)": None,
    "return [0] * -1 + None": 'TypeError: can only concatenate list (not "NoneType") to list',
}


# what stands in the plugin; the line that fails, and what is said of it
AT_IMPORT = {
    "1 / 0": (1, "ZeroDivisionError: division by zero"),
    "def f(:": (1, "SyntaxError: invalid syntax"),
    "raise SystemExit(0)": (1, "SystemExit: 0"),
    "import no_such_module": (1, "ModuleNotFoundError: No module named 'no_such_module'"),
    "from aerobat import no_such_name": (1, "ImportError: cannot import name 'no_such_name'"),
    "import aerobat as ab\nab.tilted_gate((0.0, 0.0))": (2, "position must be 3 numbers"),
    "import aerobat as ab\n@ab.maneuver('')\nclass A(ab.Maneuver): ...": (2, "must be one line of text"),
    "import aerobat as ab\n@ab.maneuver(3)\nclass A(ab.Maneuver): ...": (2, "kind must be text, got 3"),
    "import aerobat as ab\n@ab.maneuver('f')\ndef f(): ...": (2, "a maneuver is a class"),
    "import aerobat as ab\n@ab.controller('c')\nclass A: ...": (2, "must inherit from ControlLaw"),
    "import aerobat as ab\n@ab.controller('c')\nclass A(ab.ControlLaw): ...": (2, "A has no step"),
    "import aerobat as ab\n@ab.planner('miqp')\nclass A(ab.Planner):\n    def plan(*_): ...": (
        2,
        "there are two planners named 'miqp', Miqp of aerobat.planning.miqp.miqp and A of",
    ),
    "import aerobat as ab\n@ab.maneuver('m')\nclass A(ab.Maneuver):\n    x: 'Y'\n    stage_sequence = 3": (
        2,
        "a field whose type is no known name",
    ),
}
# what stands in a law, and what is said of it beside its file and line
OF_FOUR = "not the state and a RotorWrench of four numbers"
IN_A_LAW = {
    ("step", 'raise ValueError("boom")'): "ValueError: boom",
    ("step", "return None"): "step() returned None, not the state and a RotorWrench",
    (
        "step",
        'return state, RotorWrench("a", (0.0, 0.0, 0.0))',
    ): OF_FOUR,
    ("step", "return state, RotorWrench(1.0, (0.0, 0.0))"): OF_FOUR,
    ("step", "return (state, 1.0), RotorWrench(1.0, (0.0, 0.0, 0.0))"): "of another shape than before",
    (
        "step",
        "return state, RotorWrench(seen.height, (0.0, 0.0, 0.0))",
    ): "AttributeError: 'Seen' object",
    (
        "step",
        "return state, RotorWrench(abs(seen.body.position[2]), (0.0, 0.0, 0.0))",
    ): "step() cannot be compiled for `return state, RotorWrench(abs(",
    ("step", "return seen.thrusts[9]"): "IndexError: tuple index out of range",
    ("init", 'raise KeyError("gain")'): "KeyError: 'gain'",
    ("init", 'return "none"'): "init() returned 'none', not a tree of tuples of numbers",
    ("field", "gain: float"): "is flown at the defaults of its gains: Mine.gain is missing",
}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)


def in_one_sentence(err: str) -> str:
    assert err.startswith("aerobat: ")
    assert err.count("\n") == 1, err
    assert "Traceback" not in err
    return err


@pytest.mark.parametrize(("body", "said"), IN_A_LINE.items(), ids=list(IN_A_LINE))
def test_what_fails_in_a_maneuver_of_ones_own_is_one_sentence_with_file_and_line(
    body: str, said: str | None, capsys, request: pytest.FixtureRequest
) -> None:
    name = f"mine-{list(IN_A_LINE).index(body)}"
    text = MANEUVER.format(name=name, body=body)
    Path("mine.py").write_text(text)
    Path("mine.toml").write_text(PROBLEM.format(name=name))
    code, out, err = run(capsys, "plan", "mine.toml", "--import", "mine.py")
    assert (code, out) == (2, "")
    sentence = in_one_sentence(err)
    if said is not None:
        assert said in sentence
    if said is not None and "StageSequence" not in said:
        line = text[: text.index(body)].count("\n") + 1
        assert f"{Path('mine.py').resolve()}:{line}: " in sentence
        assert "--traceback shows" in sentence


@pytest.mark.parametrize(("body", "said"), IN_A_PLAN.items(), ids=list(IN_A_PLAN))
def test_what_fails_in_a_planner_of_ones_own_is_one_sentence(body: str, said: str | None, capsys) -> None:
    name = f"mine-{list(IN_A_PLAN).index(body)}"
    Path("mine.py").write_text(PLANNER.format(name=name, body=body))
    code, out, err = run(capsys, "plan", "line", "--import", "mine.py", "--planner", name)
    assert (code, out) == (2, "")
    assert said is None or said in in_one_sentence(err)


@pytest.mark.parametrize(
    ("name", "body", "said"),
    [
        ("mine-a", "return object()", "from begin(), which has no motion"),
        ("mine-b", "raise OSError('no server')", "OSError: no server"),
    ],
)
def test_what_fails_in_a_plant_of_ones_own_is_one_sentence(name: str, body: str, said: str, capsys) -> None:
    Path("mine.py").write_text(PLANT.format(name=name, body=body))
    code, _, err = run(capsys, "fly", "line", "--order", "4", "--import", "mine.py", "--plant", name)
    assert code == 2
    assert said in in_one_sentence(err)


@pytest.mark.parametrize("text", AT_IMPORT, ids=range(len(AT_IMPORT)))
def test_what_fails_while_a_plugin_is_imported_is_one_sentence_with_file_and_line(text: str, capsys) -> None:
    Path("mine.py").write_text(text)
    code, out, err = run(capsys, "plan", "line", "--import", "mine.py")
    line, said = AT_IMPORT[text]
    assert (code, out) == (2, "")
    assert f"mine.py:{line}" in in_one_sentence(err)
    assert said in err
    assert not Path("out").exists()


@pytest.mark.parametrize("place", IN_A_LAW, ids=range(len(IN_A_LAW)))
def test_what_fails_in_a_law_of_ones_own_is_one_sentence_with_file_and_line(
    place: tuple[str, str], capsys
) -> None:
    name = f"mine-{list(IN_A_LAW).index(place)}"
    text = LAW.format(**{"name": name, "field": "", "init": "return ()", "step": HOVER} | dict([place]))
    Path("mine.py").write_text(text)
    shared_plan("line").save("line.plan")
    code, out, err = run(capsys, "fly", "line.plan", "--import", "mine.py", "--controller", name)
    assert (code, out) == (2, "")
    assert f"{Path('mine.py').resolve()}:" in in_one_sentence(err)
    assert IN_A_LAW[place] in err
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "return ab.Plan(problem, ab.Trajectory([1.0], [[[float('nan')] * 3]]), 'x')",
            "coefficients must be",
        ),
        ("return 'plan'", "returned 'plan' from plan(), not a Plan"),
        ("yield problem", "from plan(), not a Plan"),
    ],
)
def test_wrong_values_of_a_planner_name_its_file_and_line(body: str, said: str, capsys) -> None:
    name = f"mine-v{len(body)}"
    Path("mine.py").write_text(PLANNER.format(name=name, body=body))
    code, _, err = run(capsys, "plan", "line", "--import", "mine.py", "--planner", name)
    assert code == 2
    assert f"{Path('mine.py').resolve()}:" in in_one_sentence(err)
    assert said in err


def test_a_law_that_asks_for_no_number_is_flown_and_its_flight_told_to_have_failed(capsys) -> None:
    step = "return state, RotorWrench(float('nan'), (0.0, 0.0, 0.0))"
    Path("mine.py").write_text(LAW.format(name="mine-nan", field="", init="return ()", step=step))
    shared_plan("line").save("line.plan")
    code, out, err = run(capsys, "fly", "line.plan", "--import", "mine.py", "--controller", "mine-nan")
    assert (code, err) == (1, "")
    assert "certified, but this flight fails" in out


def test_traceback_shows_all_of_what_failed_in_a_plugin(capsys) -> None:
    Path("mine.py").write_text(PLANNER.format(name="mine-t", body='raise KeyError("thrust")'))
    with pytest.raises(KeyError, match="thrust"):
        run(capsys, "plan", "line", "--import", "mine.py", "--planner", "mine-t", "--traceback")


def test_an_unknown_maneuver_hints_at_import(capsys) -> None:
    Path("mine.toml").write_text(PROBLEM.format(name="knife-edge-of-my-own"))
    code, _, err = run(capsys, "plan", "mine.toml")
    assert code == 2
    assert "--import FILE.py" in in_one_sentence(err)


@pytest.mark.parametrize(
    ("arguments", "code", "kind", "field"),
    [
        (("fly", "mine.toml"), 2, "bad_input", "start.position"),
        (("fly", "no-such-problem"), 2, "bad_input", None),
        (("plan", "line", "--rate", "-1"), 2, "bad_input", "--rate"),
        (("plan", "line", "--no-such-option"), 2, "bad_input", "--no-such-option"),
        (("plan", "line", "--planner", "min-snap", "--paper"), 2, "bad_input", "--paper"),
        (("plan", "hard.toml"), 3, "no_plan", "stage 'gate'"),
    ],
)
def test_with_json_errors_are_data_on_standard_output(
    arguments: tuple[str, ...], code: int, kind: str, field: str | None, capsys
) -> None:
    Path("mine.toml").write_text(PROBLEM.format(name="line").replace("[0.0, 0.0, 1.0]", '"here"'))
    problem = PROBLEM.format(name="flip").replace("kind", "min_inverted_thrust = 45.0\nmaneuver.kind", 1)
    Path("hard.toml").write_text(problem + "gate.position = [0.5, 0.0, 5.0]\ngate.tilt_deg = 180.0\n")
    found, out, err = run(capsys, *arguments, "--json")
    assert found == code
    error = json.loads(out)["error"]
    assert set(error) == {"kind", "message", "field"}
    assert error["kind"] == kind
    assert in_one_sentence(err) == f"aerobat: {error['message']}\n"
    assert error["field"] == field
    assert run(capsys, *arguments)[1] == ""


def test_an_interrupt_with_json_is_data_too(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(fly_command, "named_controller", interrupted)
    code, out, _ = run(capsys, "fly", "line", "--json")
    assert code == 130
    assert json.loads(out) == {"error": {"kind": "interrupted", "message": "interrupted", "field": None}}
