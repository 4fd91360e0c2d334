"""`aerobat vehicles`: presets to begin with, one's own as it was understood, robots imported."""

from pathlib import Path

import pytest

from aerobat.vehicle import load_vehicle, vehicle_names
from command_lines import run, without_pictures
from places import CASES, ROOT

ANNOTATED = ROOT / "examples" / "vehicles" / "annotated.toml"
ROBOTS = CASES / "robots"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)


@pytest.mark.parametrize("name", vehicle_names())
def test_a_preset_that_is_printed_and_loaded_is_that_preset(name: str, capsys) -> None:
    code, out, err = run(capsys, "vehicles", name)
    assert (code, err) == (0, "")
    Path(f"{name}.toml").write_text(out, encoding="utf-8")
    assert load_vehicle(f"./{name}.toml") == load_vehicle(name)
    assert out.count("#") > 5  # sources and all


def test_a_vehicle_of_ones_own_is_printed_as_it_was_understood(capsys) -> None:
    code, out, err = run(capsys, "vehicles", ANNOTATED)
    assert (code, err) == (0, "")
    Path("again.toml").write_text(out, encoding="utf-8")
    assert load_vehicle("again.toml") == load_vehicle(ANNOTATED)
    assert "inertia = [0.0016, 0.0018, 0.0029]\n" in out


def test_a_file_is_written_once_and_never_over_another(capsys) -> None:
    assert run(capsys, "vehicles", "crazyflie", "--out", "mine.toml") == (0, "", "")
    written = Path("mine.toml").read_bytes()
    code, out, err = run(capsys, "vehicles", "agile-quad", "--out", "mine.toml")
    assert (code, out) == (2, "")
    assert err == "aerobat: --out mine.toml is there already; name a new file\n"
    assert Path("mine.toml").read_bytes() == written
    code, _, err = run(capsys, "vehicles", "--out", "all.toml")
    assert (code, err) == (2, "aerobat: --out writes one vehicle; name it\n")


def test_a_robot_is_imported_and_flown_from_its_own_file_too(capsys) -> None:
    assert run(capsys, "vehicles", ROBOTS / "iris.sdf", "--out", "iris.toml") == (0, "", "")
    assert load_vehicle("iris.toml").mass == pytest.approx(1.535)
    code, _, err = run(capsys, "plan", "line", "--vehicle", ROBOTS / "iris.sdf", "--planner", "min-snap")
    assert (code, err) == (0, "")


def test_what_a_robot_lacks_is_told_and_its_file_written_all_the_same(capsys) -> None:
    code, out, err = run(capsys, "vehicles", ROBOTS / "crazyflie.urdf", "--out", "mine.toml")
    assert (code, out) == (0, "")
    assert err.endswith("crazyflie.urdf says nothing of the rotors' spin, lag; add them\n")
    code, _, err = run(capsys, "plan", "line", "--vehicle", "mine.toml")
    assert code == 2
    assert "rotors[0].spin is missing; add it there or, for all rotors, in [rotor_defaults]" in err


def test_a_dead_rotor_is_told_with_what_remains(capsys) -> None:
    run(capsys, "vehicles", "agile-quad", "--out", "failed.toml")
    text = Path("failed.toml").read_text(encoding="utf-8")
    Path("failed.toml").write_text(
        text.replace("spin = -1", "spin = -1\nmax_thrust = 0", 1), encoding="utf-8"
    )
    code, _, err = run(capsys, "vehicles", "failed.toml")
    assert code == 0
    assert "cannot hold a level hover without rotors[0] (max_thrust = 0)" in err
    code, out, refused = run(capsys, "fly", "line", "--vehicle", "failed.toml")
    assert (code, out) == (2, "")
    assert refused.count("\n") == 2  # told when it is read, and refused when it shall fly
    assert not Path("out").exists()
