"""Plan files as others read them: by a schema, by NumPy alone, and from one version to the next."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import aerobat as ab
import flight_package
from aerobat import so3
from aerobat.storage import digest_of
from flight_package import read_flight_package
from places import CASES, ROOT
from shared_plans import shared_plan
from turning_paths import turning

SCHEMA = ROOT / "docs" / "plan.schema.json"
EARLIER = CASES / "plans" / "revision-0.plan"  # written before there were revisions
WITHOUT_THE_REST = """
import sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in sys.stdlib_module_names and top not in ("numpy", "reader"):
            raise ImportError(f"{top} is not here")
sys.meta_path.insert(0, Refuse())
from reader import read_flight_package
package = read_flight_package(sys.argv[1])
setpoints = package.setpoints([0.0, package.duration / 2, package.duration])
print(setpoints.position[1].tolist())
"""


@pytest.fixture(scope="module")
def windy() -> ab.Plan:
    """A half-flip in wind, with drag, a heading and a yaw, not what it was planned for."""
    plan = shared_plan("half-flip")
    environment = ab.Environment(gravity=9.7, wind=(1.0, -2.0, 0.5))
    return replace(
        plan,
        problem=replace(plan.problem, environment=environment),
        vehicle=replace(plan.vehicle, drag_body=(0.2, 0.2, 0.05)),
        trajectory=turning(replace(plan.trajectory, heading=0.8), 2.0),
    )


def document_of(path: Path) -> Any:
    with np.load(path) as file:
        return json.loads(file["document"].tobytes())


def test_the_schema_is_that_of_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs")
    from make_plan_schema import schema

    assert SCHEMA.read_text(encoding="utf-8") == schema(), "run docs/make_plan_schema.py"


def test_what_is_saved_and_what_was_saved_earlier_follow_the_schema(windy: ab.Plan, tmp_path: Path) -> None:
    validator = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
    windy.save(tmp_path / "windy.plan")
    ab.Plan(windy.problem, windy.trajectory, "miqp").save(tmp_path / "bare.plan")
    for path in (tmp_path / "windy.plan", tmp_path / "bare.plan", EARLIER):
        validator.validate(document_of(path))
    document = document_of(tmp_path / "windy.plan")
    document["evidence"]["certificate"]["findings"][0]["verdict"] = "perhaps"
    with pytest.raises(jsonschema.ValidationError):
        validator.validate(document)


def test_numpy_alone_reads_what_the_vehicle_is_to_do(windy: ab.Plan, tmp_path: Path) -> None:
    windy.save(tmp_path / "windy.plan")
    package = read_flight_package(tmp_path / "windy.plan")
    times = np.linspace(0.0, windy.duration, 400)
    found, planned = package.setpoints(times), ab.reference(windy, times=times).setpoint
    for name in ("position", "velocity", "acceleration", "jerk"):
        np.testing.assert_allclose(getattr(found, name), getattr(planned.flat, name), rtol=1e-9, atol=1e-9)
    assert so3.angle_between(found.q_world_body, planned.q_world_body).max() < 1e-5
    np.testing.assert_allclose(found.omega_body, planned.omega_body, atol=1e-3)
    np.testing.assert_allclose(found.thrust, planned.wrench.thrust, atol=1e-4)


def test_the_reader_needs_nothing_beside_numpy(tmp_path: Path) -> None:
    (tmp_path / "reader.py").write_bytes(Path(flight_package.__file__).read_bytes())
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_THE_REST, str(EARLIER)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    plan = ab.load_plan(EARLIER)
    np.testing.assert_allclose(
        json.loads(done.stdout), plan.trajectory.evaluate(plan.duration / 2), atol=1e-12
    )


def test_earlier_revisions_are_read_and_proven_as_they_were() -> None:
    plan = ab.load_plan(EARLIER)
    package = read_flight_package(EARLIER)
    assert plan.certified
    assert package.certified
    assert package.gravity == plan.problem.environment.gravity
    np.testing.assert_array_equal(package.wind, plan.problem.environment.wind)


def test_keys_of_later_revisions_are_left_out_and_other_formats_refused(
    windy: ab.Plan, tmp_path: Path
) -> None:
    path = tmp_path / "later.plan"
    windy.save(path)
    with np.load(path) as file:
        content = dict(file)
    document = json.loads(content["document"].tobytes())
    document["weather"] = "fine"
    document["evidence"]["mood"] = "calm"
    document["revision"] += 1
    content["document"] = np.frombuffer(json.dumps(document).encode(), dtype=np.uint8)
    with path.open("wb") as file:
        later = {**content, "extra": np.zeros(3)}
        del later["digest"]
        np.savez(file, **later, digest=digest_of(later))
    assert ab.load_plan(path) == windy
    assert read_flight_package(path).document["weather"] == "fine"
    with path.open("wb") as file:
        np.savez(file, **{**content, "format": "aerobat-plan-2"})
    for read in (ab.load_plan, read_flight_package):
        with pytest.raises(ValueError, match="aerobat-plan-2"):
            read(path)


def test_what_is_not_proven_is_not_said_to_be(windy: ab.Plan, tmp_path: Path) -> None:
    for plan in (windy.for_vehicle(ab.load_vehicle("crazyflie")), replace(windy, vehicle=None)):
        plan.save(tmp_path / "x.plan")
        assert not plan.certified
        assert not read_flight_package(tmp_path / "x.plan").certified


def test_a_plan_without_a_vehicle_has_a_path_alone(windy: ab.Plan, tmp_path: Path) -> None:
    replace(windy, vehicle=None).save(tmp_path / "x.plan")
    package = read_flight_package(tmp_path / "x.plan")
    np.testing.assert_allclose(package.evaluate(0.5, 2)[0], windy.trajectory.evaluate(0.5, 2), atol=1e-9)
    with pytest.raises(ValueError, match="no vehicle"):
        package.setpoints([0.0])
