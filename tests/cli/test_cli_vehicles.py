"""`aerobat show`: presets to begin with, one's own as it was understood, robots imported."""

from dataclasses import replace
from pathlib import Path

import pytest

from aerobat.problem import load_problem
from aerobat.vehicle import load_vehicle, vehicle_names, write_vehicle
from command_lines import run, without_pictures
from places import CASES, ROOT

ANNOTATED = ROOT / "examples" / "vehicles" / "annotated.toml"
ROBOTS = CASES / "robots"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)


@pytest.mark.parametrize("name", vehicle_names())
def test_a_preset_that_is_written_and_loaded_is_that_preset(name: str, capsys) -> None:
    assert run(capsys, "show", name, "--out", f"{name}.toml") == (0, "", "")
    assert load_vehicle(f"./{name}.toml") == load_vehicle(name)
    assert Path(f"{name}.toml").read_text(encoding="utf-8").count("#") > 5  # sources and all
    code, out, err = run(capsys, "show", name)
    assert (code, err) == (0, "")
    assert out.rstrip().endswith("nothing")  # looks wrong


def test_a_vehicle_of_ones_own_is_written_as_it_was_understood(capsys) -> None:
    assert run(capsys, "show", ANNOTATED, "--out", "again.toml") == (0, "", "")
    assert load_vehicle("again.toml") == load_vehicle(ANNOTATED)
    assert "inertia = [0.0016, 0.0018, 0.0029]\n" in Path("again.toml").read_text(encoding="utf-8")


def test_a_vehicle_is_told_as_a_pilot_knows_it_and_so_is_what_looks_wrong(capsys) -> None:
    code, out, _ = run(capsys, "show", "agile-quad")
    assert code == 0
    facts = " ".join(out.split())
    assert "3.30 times the weight" in facts
    assert "hover at 30 %" in facts
    assert "4: front left clockwise, front right counter-clockwise, back right clockwise, back left" in facts
    assert "rad/s" in facts
    heavy = replace(load_vehicle("agile-quad"), mass=2.2)
    write_vehicle(heavy, "heavy.toml")
    facts = " ".join(run(capsys, "show", "heavy.toml")[1].split())
    assert "max_thrust adds up to 1.2" in facts
    assert "a hover takes 78 % of a rotor's thrust" in facts


def test_all_keys_that_are_missing_are_told_at_once(capsys) -> None:
    Path("mine.toml").write_text("[[rotors]]\n")
    _, _, err = run(capsys, "show", "mine.toml")
    assert (
        "rotors[0].position_body, spin, min_thrust, max_thrust, torque_coefficient, lag and radius are" in err
    )
    Path("mine.toml").write_text("mass = 1.0\n")
    _, _, err = run(capsys, "show", "mine.toml")
    assert err == "aerobat: vehicle file mine.toml: inertia and rotors are missing; add them\n"
    Path("mine.toml").write_text('description = "of mine"\nmax_body_rate = 20.0\n')
    _, _, err = run(capsys, "show", "mine.toml")
    assert err == "aerobat: vehicle file mine.toml: mass, inertia and rotors are missing; add them\n"
    Path("mine.toml").write_text('description = "of mine"\n[limits]\nvelocity = 2.0\n')
    _, _, err = run(capsys, "show", "mine.toml")
    assert err.startswith("aerobat: problem file mine.toml: ")


def test_rotors_that_all_spin_alike_are_refused_as_a_pilot_would_say_it(capsys) -> None:
    run(capsys, "show", "agile-quad", "--out", "mine.toml")
    text = Path("mine.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(text.replace("spin = -1", "spin = 1"), encoding="utf-8")
    code, _, err = run(capsys, "show", "mine.toml")
    assert code == 2
    assert "all 4 spin alike, counter-clockwise" in err
    assert "rank" not in err


def test_a_problem_is_written_to_begin_ones_own_with(capsys) -> None:
    assert run(capsys, "show", "flip-roll", "--out", "mine.toml") == (0, "", "")
    assert load_problem("./mine.toml") == load_problem("flip-roll")
    assert run(capsys, "show", "flip-roll")[1] == Path("mine.toml").read_text(encoding="utf-8")
    code, _, err = run(capsys, "show", "line", "--out", "mine.toml")
    assert (code, err) == (2, "aerobat: --out mine.toml is there already; name a new file\n")
    assert run(capsys, "show", "flap")[0] == 2


def test_the_papers_name_of_a_thrust_is_answered_by_its_name_here(capsys) -> None:
    run(capsys, "show", "flip-roll", "--out", "mine.toml")
    text = Path("mine.toml").read_text(encoding="utf-8")
    Path("mine.toml").write_text(text.replace("[maneuver]", "[maneuver]\nepsilon_z = 25.0"), encoding="utf-8")
    _, _, err = run(capsys, "show", "mine.toml")
    assert "the paper's ε is min_lateral_thrust or min_inverted_thrust here" in err


def test_a_file_is_written_once_and_never_over_another(capsys) -> None:
    assert run(capsys, "show", "crazyflie", "--out", "mine.toml") == (0, "", "")
    written = Path("mine.toml").read_bytes()
    code, out, err = run(capsys, "show", "agile-quad", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert err == "aerobat: --out mine.toml is there already; name a new file\n"
    assert Path("mine.toml").read_bytes() == written
    code, _, err = run(capsys, "show", "--out", "all.toml")
    assert (code, err) == (2, "aerobat: --out writes one problem or one vehicle; name it\n")


def test_a_robot_is_imported_and_flown_from_its_own_file_too(capsys) -> None:
    assert run(capsys, "show", ROBOTS / "iris.sdf", "--out", "iris.toml") == (0, "", "")
    assert load_vehicle("iris.toml").mass == pytest.approx(1.535)
    code, _, err = run(capsys, "plan", "line", "--vehicle", ROBOTS / "iris.sdf", "--planner", "min-snap")
    assert (code, err) == (0, "")


def test_what_a_robot_lacks_is_told_and_its_file_written_all_the_same(capsys) -> None:
    code, out, err = run(capsys, "show", ROBOTS / "crazyflie.urdf", "--out", "mine.toml")
    assert (code, out) == (0, "")
    assert err.endswith("crazyflie.urdf says nothing of the rotors' spin, lag; add them\n")
    code, _, err = run(capsys, "plan", "line", "--vehicle", "mine.toml")
    assert code == 2
    assert "rotors[0].spin and lag are missing; add them there or, for all rotors, in [rotor_defaults]" in err


def test_a_dead_rotor_is_told_with_what_remains(capsys) -> None:
    run(capsys, "show", "agile-quad", "--out", "failed.toml")
    text = Path("failed.toml").read_text(encoding="utf-8")
    Path("failed.toml").write_text(
        text.replace("spin = -1", "spin = -1\nmax_thrust = 0", 1), encoding="utf-8"
    )
    code, out, _ = run(capsys, "show", "failed.toml")
    assert code == 0
    assert "cannot hold a level hover without rotors[0] (max_thrust = 0)" in " ".join(out.split())
    code, out, refused = run(capsys, "fly", "line", "--vehicle", "failed.toml")
    assert (code, out) == (2, "")
    assert refused.count("\n") == 2  # told when it is read, and refused when it shall fly
    assert not Path("out").exists()
