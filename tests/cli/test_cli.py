"""The main job from one command: what it prints, what it writes, how it ends."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.interchange import write_columns
from aerobat.interchange.csv import read_csv
from aerobat.planning import load_plan
from aerobat.problem import (
    GatePassage,
    Limits,
    Line,
    load_problem,
    problem_names,
    tilted_gate,
    write_problem,
)
from aerobat.simulation import load_flight
from aerobat.vehicle import vehicle_names
from command_lines import code, run, without_pictures
from shared_plans import shared_plan

PLAN_KEYS = {
    "planner", "order", "intervals", "dt_s", "duration_s", "cost", "backend", "nodes", "solve_time_s",
    "stages", "attempts", "min_rotor_thrust_n", "max_rotor_thrust_n", "rotor_feasible",
}  # fmt: skip
FLIGHT_KEYS = {
    "max_position_error_m", "rms_position_error_m", "max_attitude_error_deg", "rms_attitude_error_deg",
    "passages", "saturated_fraction", "outcome", "sentence",
}  # fmt: skip

PAPERS = ("flip-roll", "flip-roll-translation", "flip-pitch", "half-flip", "line", "section-v")


MARS = """
name = "mars"
heading_deg = 90.0
start = { position = [0.0, 0.0, 0.0] }
goal = { position = [3.0, 0.0, 0.0] }
environment = { gravity = 3.7, wind = [0.0, 1.0, 0.0] }
maneuver = { kind = "line" }
limits = { velocity = 2.5 }
"""


@pytest.fixture
def unpictured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without their pictures, which take longer than flights."""
    without_pictures(monkeypatch)


@pytest.fixture(scope="module")
def mars(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a flight on another planet, of a vehicle that `check` does not assume by itself."""
    folder = tmp_path_factory.mktemp("mars")
    problem = folder / "mars.toml"
    problem.write_text(MARS)
    with pytest.MonkeyPatch.context() as patch:
        without_pictures(patch)
        assert (
            code("fly", problem, "--vehicle", "crazyflie", "--conditions", "none", "--out", folder / "run")
            == 0
        )
    return folder / "run"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_help_tells_the_commands(capsys) -> None:
    code, out, _ = run(capsys, "--help")
    assert code == 0
    assert "Plan a maneuver, fly it" in out


@pytest.mark.parametrize(
    "command",
    [
        "fly",
        "plan",
        "compare",
        "check",
        "feasibility",
        "sweep",
        "causes",
        "tune",
        "inspect",
        "view",
        "link mavlink",
    ],
)
def test_the_help_of_a_command_names_no_option_that_it_has_not(command: str, monkeypatch, capsys) -> None:
    monkeypatch.setenv("COLUMNS", "1000")
    out, _, _ = run(capsys, *command.split(), "--help")[1].partition("Exit codes")
    own = set(
        re.findall(r"(--[a-z-]+)", " ".join(re.findall(r"^│ [* ]*[A-Z]* ?((?:--[a-z-]+ )+)", out, re.M)))
    )
    assert own
    assert set(re.findall(r"--[a-z][a-z-]*", out)) == own


def test_a_sweep_writes_no_table_of_its_plan_and_takes_no_columns(capsys) -> None:
    assert run(capsys, "sweep", "line", "--columns", "paper")[0] == 2


def test_fly_writes_the_plan_the_flight_the_picture_and_the_report(capsys) -> None:
    code, out, err = run(capsys, "fly", "half-flip", "--conditions", "none")
    assert (code, err) == (0, "")
    folder = Path("out/half-flip-none")
    written = ["flight.npz", "half-flip.plan", "plan.csv", "report.json", "report.png", "run.toml"]
    assert sorted(p.name for p in folder.iterdir()) == written
    report = json.loads((folder / "report.json").read_text())
    assert report["plan"].keys() >= PLAN_KEYS
    assert report["flight"].keys() >= FLIGHT_KEYS
    assert report["problem"] == "half-flip"
    assert report["vehicle"] == "agile-quad"
    assert report["plan"]["rotor_feasible"] is True
    assert report["plan"]["certificate"]["certified"] is True
    assert read_csv(folder / "plan.csv").duration == pytest.approx(report["plan"]["duration_s"])
    assert load_flight(folder / "flight.npz").times[-1] == pytest.approx(report["plan"]["duration_s"])
    assert (folder / "report.png").read_bytes().startswith(b"\x89PNG")
    assert "half-flip · agile-quad: certified, and it flies" in out
    for name in ("duration", "limited by", "margin", "space", "gate", "flight"):
        assert re.search(rf"^ +{name} ", out, re.MULTILINE)
    assert out.endswith(
        "`aerobat sweep out/half-flip-none` counts more flights\nwritten to out/half-flip-none/\n"
    )


def test_a_plan_that_few_flights_survive_is_not_well_unless_nothing_shall_vary(capsys, unpictured) -> None:
    """Without a reserve, disturbances move the vehicle off its path."""
    shared_plan("line", "agile-quad", ab.Miqp()).save("line.plan")
    code, out, _ = run(capsys, "fly", "line.plan")
    assert code == 1
    assert "line · agile-quad: certified, but too few flights succeed under 'lab' conditions" in out
    told = " ".join(out.split())
    assert re.search(r"lab: \d+ of 100 flights succeed, so [\d.]+ to [\d.]+ % of all, .* --pass 0\.95", told)
    code, out, _ = run(capsys, "fly", "line.plan", "--conditions", "none")
    assert code == 0
    assert "of 100" not in out


@pytest.mark.slow
@pytest.mark.parametrize("problem", [*PAPERS, "power-loop"])
def test_json_is_the_report_and_nothing_else(problem: str, capsys) -> None:
    code, out, err = run(capsys, "fly", problem, "--json", "--out", "here")
    written = json.loads(Path("here/report.json").read_text())
    assert (code, err) == (int(not written["trials"]["proven"]), "")
    assert json.loads(out) == written


@pytest.mark.usefixtures("unpictured")
def test_plan_stops_after_planning(capsys) -> None:
    code, out, err = run(capsys, "plan", "half-flip", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report == json.loads(Path("out/half-flip/report.json").read_text())
    assert "flight" not in report
    flyability = report["plan"]["flyability"]
    assert flyability["flies"] is True
    assert 0.0 < flyability["error_m"] < flyability["disturbed_error_m"] < 0.15
    written = sorted(p.name for p in Path("out/half-flip").iterdir())
    assert written == ["half-flip.plan", "plan.csv", "report.json", "report.png", "run.toml"]


@pytest.mark.slow
def test_what_takes_seconds_to_know_is_told_where_it_is_asked_for(capsys) -> None:
    """By --explain, and by check of the plan; the plan and the numbers of its flight are the same."""
    code, out, _ = run(capsys, "fly", "line", "--json", "--out", "plain")
    assert code == 0
    plain = json.loads(out)
    assert plain["plan"]["recoveries"] is None
    assert load_plan("plain/line.plan").recoveries is None
    code, out, _ = run(capsys, "fly", "line", "--json", "--explain", "--out", "explained")
    assert code == 0
    explained = json.loads(out)
    recoveries = explained["plan"]["recoveries"]
    assert recoveries["sentence"].startswith("given up at any of ")
    assert load_plan("explained/line.plan").recoveries is not None
    assert explained["flight"] == plain["flight"]
    trials = explained["trials"]
    sweep = ab.sweep(load_plan("plain/line.plan"), "lab", trials["flights"])
    assert (trials["conditions"], trials["succeeded"]) == ("lab", sweep.success.count)
    assert explained["trials"] == plain["trials"]
    assert explained["plan"]["assessment"] == plain["plan"]["assessment"]
    code, out, _ = run(capsys, "check", "plain", "--json")
    assert code == 0
    assert json.loads(out)["recoveries"] == recoveries
    code, out, _ = run(capsys, "check", "plain")
    assert code == 0
    assert recoveries["sentence"] in " ".join(out.split())
    code, out, _ = run(capsys, "repeat", "plain", "--explain")
    assert code == 0
    for word in ("planner", "rotors", "position error", "saturated", "flyability", "recovery"):
        assert word in out
    assert re.search(r"controller +full", out)
    plain = run(capsys, "repeat", "plain")[1]
    assert "recovery" not in plain
    assert "saturated" not in plain


@pytest.mark.slow
def test_a_plan_that_takes_suspiciously_long_says_so_and_what_to_give(capsys) -> None:
    words = ("plan", "section-v", "--vehicle", "section-v", "--planner", "min-snap")
    code, out, _ = run(capsys, *words)
    assert code == 0
    told = "warning it may take longer than need be; --explain asks another planner"
    assert told in " ".join(out.split())
    written = json.loads(Path("out/section-v-section-v-min-snap/report.json").read_text())
    assessed = written["plan"]["assessment"]
    assert (assessed["suspicious"], assessed["second_opinion"]) == (True, None)
    code, out, _ = run(capsys, *words, "--explain", "--json")
    assert code == 0
    assert json.loads(out)["plan"]["assessment"]["second_opinion"]["duration"] < 2.3  # of 3.1 s


@pytest.mark.slow
def test_check_judges_a_plan_of_what_cannot_hover_all_the_same(capsys) -> None:
    """The exit code is the proof's; of the way back it is told that there is none."""
    run(capsys, "plan", "line")
    run(capsys, "show", "agile-quad", "--out", "agile.toml")
    text = Path("agile.toml").read_text(encoding="utf-8")
    Path("heavy.toml").write_text(re.sub(r"(?m)^mass = .*$", "mass = 20.0", text, count=1))
    code, out, _ = run(capsys, "check", "out/line", "--vehicle", "heavy.toml", "--json")
    assert code == 1
    facts = json.loads(out)
    assert not facts["certified"]
    assert facts["recoveries"]["sentence"] == "from no instant does it come back to a hover"


@pytest.mark.slow
def test_paper_mode_prints_the_known_optimum(capsys) -> None:
    _, out, _ = run(capsys, "fly", "flip-roll", "--paper", "--json")
    report = json.loads(out)
    assert report["plan"]["cost"] == pytest.approx(273196.1243, rel=1e-9)
    assert (report["plan"]["order"], report["plan"]["dt_s"]) == (3, 0.1)
    assert report["vehicle"] == "hexarotor"
    assert report["flight"]["max_position_error_m"] < 0.05
    assert report["flight"]["controller"] == "full"


@pytest.mark.usefixtures("unpictured")
def test_the_papers_own_law_flies_where_it_is_asked_for(capsys) -> None:
    """As the paper's half-flip goes with nothing beyond its law: 56 cm and half a turn off."""
    _, out, _ = run(capsys, "fly", "half-flip", "--paper", "--controller", "paper", "--json")
    report = json.loads(out)
    assert (report["vehicle"], report["plan"]["order"]) == ("hexarotor", 3)
    flight = report["flight"]
    assert flight["controller"] == "paper"
    assert flight["max_position_error_m"] == pytest.approx(0.557, abs=0.005)
    assert flight["max_attitude_error_deg"] == pytest.approx(180.0, abs=0.5)


@pytest.mark.slow
def test_the_full_law_flies_the_papers_half_flip_as_it_was_planned(capsys) -> None:
    _, out, _ = run(capsys, "fly", "half-flip", "--paper", "--json")
    assert json.loads(out)["flight"]["max_position_error_m"] < 0.03


@pytest.mark.slow
@pytest.mark.usefixtures("unpictured")
def test_the_gates_tilt_is_what_angle_says(capsys) -> None:
    _, out, _ = run(capsys, "fly", "half-flip", "--angle", "40", "--json")
    flight = load_flight("out/half-flip-40deg/flight.npz")
    states = flight.states
    gate = json.loads(out)["plan"]["stages"][0]["time_s"]
    k = int(np.argmin(np.abs(flight.times - gate)))
    w, x, y, z = states.q_world_body[k]
    thrust = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    assert np.rad2deg(np.arctan2(-thrust[1], thrust[2])) == pytest.approx(
        40.0, abs=5.0
    )  # the gate's tolerance


def test_without_arguments_three_lines_say_what_to_type_first(capsys) -> None:
    code, out, err = run(capsys)
    assert (code, err) == (0, "")
    first, *lines = out.splitlines()
    assert first.endswith("To begin with, type:")
    assert [line.split("  ")[1] for line in lines] == [
        "aerobat fly flip-roll", "aerobat show", "aerobat --help",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("sweep", "--runs --flights"),
        ("causes", "--runs --flights"),
        ("tune", "--runs --flights"),
        ("repeat", "Default: FOLDER-repeated"),
        ("fly", "or one of your own that --import brings in"),
    ],
)
def test_help_tells_what_the_command_does(command: str, said: str, capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    code, out, _ = run(capsys, command, "--help")
    assert code == 0
    assert said in " ".join(out.replace("│", " ").split())


def test_what_there_is_is_listed(capsys) -> None:
    _, out, _ = run(capsys, "show")
    assert all(name in out for name in vehicle_names())
    assert all(name in out for name in problem_names())


def test_an_infeasible_problem_ends_with_its_sentence_and_nothing_written(capsys) -> None:
    Path("hard.toml").write_text(
        'name = "hard"\n[start]\nposition = [0.0, 0.0, 0.0]\n[goal]\nposition = [0.0, 0.0, 0.0]\n'
        "[gate]\nposition = [0.0, 0.0, 5.0]\ntilt_deg = 180.0\n[maneuver]\nkind = 'flip'\n"
        "min_inverted_thrust = 45.0\n"
    )
    code, out, err = run(capsys, "fly", "hard.toml")
    assert (code, out) == (3, "")
    assert err == (
        "aerobat: the stage 'gate' asks 45 m/s² inverted, agile-quad gives 32.4; "
        "lower what it asks or take a stronger vehicle\n"
    )
    assert not Path("out").exists()


def test_a_refusal_says_how_to_ask_for_advice_and_is_followed_by_it_when_asked(capsys) -> None:
    """On standard error alone, with nothing written."""
    gated = replace(load_problem("line"), gates=(tilted_gate((5.0, 0.0, 0.0)),))
    write_problem(replace(gated, limits=Limits(velocity=0.6)), "slow.toml")
    late = Line(GatePassage(at=(0.93, 0.97)))
    write_problem(replace(gated, maneuver=late), "late.toml")
    code, out, err = run(capsys, "plan", "slow.toml", "--explain")
    assert (code, out) == (3, "")
    refusal, advice = err.splitlines()
    assert "'line' is proven to have no plan" in refusal
    assert advice.startswith("aerobat: 'line' is planned without limits.velocity (by miqp in ")
    code, out, err = run(capsys, "plan", "late.toml", "--no-rescue")
    assert (code, out) == (3, "")
    assert err.endswith("; add --explain to `aerobat plan` to try changes that would help\n")
    assert "ab.why" not in err
    assert not Path("out").exists()


def test_help_tells_every_command_and_option(capsys) -> None:
    _, out, _ = run(capsys, "--help")
    assert "Exit codes" in out
    assert all(
        command in out for command in ["fly", "plan", "check", "compare", "sweep", "tune", "inspect", "show"]
    )
    _, out, _ = run(capsys, "fly", "--help")
    options = "vehicle planner order intervals segments stop-after backend paper angle out json seed"
    assert "--controller" in out
    assert "--conditions" in out
    assert all(f"--{option}" in out for option in options.split())


def test_nothing_heavy_is_imported_before_it_is_needed() -> None:
    heavy = ["scipy", "matplotlib", "pydantic", "daqp", "gurobipy", "pyscipopt", "rich"]
    probe = f"import sys, aerobat, aerobat.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.process
def test_the_main_job_needs_no_pyplot() -> None:
    probe = (
        "import sys\nfrom aerobat.cli import main\nmain(['plan', 'line', '--reserve', '0', '--json'])\n"
        "print('matplotlib.pyplot' in sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "False"


@pytest.mark.process
def test_a_command_imports_what_it_needs() -> None:
    """To plan the fastest, no other command, no study, no sensors; of maneuvers and planners its own."""
    others = [
        "cli.commands.sweep", "studies.sweep", "viewer", "links", "simulation.conditions",
        "interchange.robots.description", "problem.maneuvers.course", "problem.maneuvers.waypoints",
    ]  # fmt: skip
    probe = (
        "import sys\nfrom aerobat.cli import main\nmain(['plan', 'line', '--reserve', '0', '--json'])\n"
        f"print([m for m in {others} if 'aerobat.' + m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "[]"


@pytest.mark.slow
def test_check_judges_what_was_planned_not_what_it_would_assume(mars: Path, capsys) -> None:
    """The plan's own vehicle, heading, gravity, wind and limits: the certificate is the plan's."""
    planned = json.loads((mars / "report.json").read_text())["plan"]["certificate"]
    code, out, err = run(capsys, "check", mars, "--json")
    assert (code, err) == (0, "")
    assert json.loads(out).items() >= planned.items()
    code, out, _ = run(capsys, "check", mars / "mars.plan", "--vehicle", "hexarotor", "--json")
    assert json.loads(out)["findings"] != planned["findings"]


def test_check_says_what_it_assumes_of_a_file_that_holds_no_more_than_a_path(mars: Path, capsys) -> None:
    _, out, _ = run(capsys, "check", mars / "plan.csv")
    assert "assumed" in out
    assert "gravity 9.81 m/s²" in out
    assert "assumed" not in run(capsys, "check", mars)[1]


@pytest.mark.usefixtures("unpictured")
def test_a_saved_plan_is_flown_as_it_is(mars: Path, capsys) -> None:
    code, _, err = run(capsys, "fly", mars / "mars.plan", "--conditions", "none", "--out", "again")
    assert (code, err) == (0, "")
    first, again = (load_flight(folder / "flight.npz") for folder in (mars, Path("again")))
    np.testing.assert_array_equal(first.states.q_world_body, again.states.q_world_body)
    code, _, err = run(capsys, "fly", mars / "mars.plan", "--order", "5")
    assert code == 2
    assert "--order plans anew" in err
    code, _, err = run(capsys, "fly", mars / "mars.plan", "--angle", "0")
    assert code == 2
    assert "--angle plans anew" in err


@pytest.mark.usefixtures("unpictured")
def test_a_folder_that_cannot_be_filled_leaves_the_earlier_run_whole(mars: Path, capsys, monkeypatch) -> None:
    shutil.copytree(mars, "out/mars")
    before = {path.name: path.read_bytes() for path in Path("out/mars").iterdir()}

    def fail(*_: object) -> bytes:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("aerobat.cli.runs.folder.write_record", fail)
    code, _, err = run(capsys, "fly", "out/mars", "--out", "out/mars")
    assert code == 2
    assert err == "aerobat: cannot write out/mars: No space left on device\n"
    assert {path.name: path.read_bytes() for path in Path("out/mars").iterdir()} == before
    assert [path.name for path in Path("out").iterdir()] == ["mars"]


@pytest.mark.parametrize(
    "command",
    [
        ["show"],
        pytest.param(["plan", "line", "--json"], marks=pytest.mark.process),
        pytest.param(["fly", "--help"], marks=pytest.mark.process),
    ],
)
def test_a_reader_that_has_enough_ends_a_command_without_a_word(command: list[str], tmp_path: Path) -> None:
    """As `aerobat ... | head` does: the pipe is closed before anything is read."""
    process = subprocess.Popen(
        [sys.executable, "-m", "aerobat", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    )
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 141


def test_check_says_commands_rates_and_gates_in_words_and_in_numbers(capsys) -> None:
    shared_plan("half-flip").save("half-flip.plan")
    code, out, err = run(capsys, "check", "half-flip.plan")
    assert (code, err) == (0, "")
    rows = out.splitlines()
    for quantity in ("thrust", "command"):  # of the rotors nearest to either limit
        assert sum(row.startswith(f"{quantity} of rotor ") for row in rows) == 2
    assert any(row.startswith("body rate") and "15 rad/s" in row for row in rows)
    assert any(row.startswith("specific thrust along") and "0 m/s²" in row for row in rows)
    assert any(row.startswith("gate 'gate'") and "holds" in row for row in rows)
    findings = json.loads(run(capsys, "check", "half-flip.plan", "--json")[1])["findings"]
    assert {f["quantity"] for f in findings if f["gate"] == "gate"} >= {
        "attitude",
        "speed through",
        "inside by",
    }
    assert {f["rotor"] for f in findings if f["quantity"] == "command"} == set(range(4))
    assert "specific thrust along (0, 0, 1)" in {f["quantity"] for f in findings}


def test_check_names_the_vehicle_that_it_assumes_of_a_bare_path(capsys) -> None:
    write_columns(shared_plan("line"), "plan.csv")
    for options, assumed in (([], True), (["--vehicle", "agile-quad"], False)):
        out = " ".join(run(capsys, "check", "plan.csv", *options)[1].split())
        assert "no limits, stages or gates of a problem" in out
        assert ("the vehicle agile-quad" in out) is assumed
