"""Whole pages: they show plan and flight, labelled, without one text over another."""

import subprocess
import sys
from dataclasses import replace
from functools import lru_cache

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver, QuiverKey

import aerobat as ab
from aerobat import so3
from aerobat.evaluation.subject import Subject
from aerobat.planning import PlacedStage
from aerobat.reporting.figures import draw, report_figure
from aerobat.reporting.page import DPI, png
from aerobat.reporting.panels import path as path_panel
from aerobat.reporting.panels.keyframes import maneuver_plane, plan_keyframes
from aerobat.reporting.panels.poses import plan_reference, reference_poses
from aerobat.reporting.panels.stages import draw_stages
from aerobat.reporting.scene.glyphs import gate_bars, span
from aerobat.reporting.style import BLUE, RED, SKY, YELLOW
from reporting_cases import (
    PROBLEMS,
    batch_of,
    drawn_gates,
    require_legible,
    simulated,
    two_flips,
    with_moving_gates,
)
from shared_plans import closed_form, shared_plan

pytestmark = pytest.mark.filterwarnings("error")  # drawing warns of nothing
YELLOW_RGBA = to_rgba(YELLOW)
OTHERS = [("flip-roll", "hexarotor", 0), ("half-flip", "crazyflie", 0), ("section-v", "section-v", 0)]
# the report of every problem, and all pages of the one without a gate; most of them in the full suite
PAGES = [
    ("flip-roll", "agile-quad", 0),
    *(
        pytest.param(*page, marks=pytest.mark.slow)
        for page in (
            *((problem, "agile-quad", 0) for problem in PROBLEMS[1:]),
            *(("line", "agile-quad", number) for number in (1, 2, 3)),
        )
    ),
]


def page(problem, vehicle="agile-quad"):
    return report_figure(shared_plan(problem, vehicle), ab.load_vehicle(vehicle), simulated(problem, vehicle))


@lru_cache
def shared_page(problem, vehicle="agile-quad", number=0):
    """One of the pages of a plan and its flight, which no test changes: reports first, drawings then."""
    plan, body, flight = shared_plan(problem, vehicle), ab.load_vehicle(vehicle), simulated(problem, vehicle)
    return (
        lambda: report_figure(plan, body, flight),
        lambda: report_figure(plan, body),
        lambda: draw(flight, plan),
        lambda: draw(flight),
    )[number]()


def panel_of(figure, quantity):
    return next(axes for axes in figure.axes if axes.get_ylabel().startswith(quantity))


def stages_axes(plan):
    """The stages alone, in a tall panel."""
    axes = Figure(figsize=(4.0, 8.0)).add_subplot()
    draw_stages(axes, plan, ab.load_vehicle("agile-quad"))
    return axes


def stages_panel(figure):
    return next(axes for axes in figure.axes if axes.get_ylabel() == "z [m]")


@pytest.mark.parametrize(
    ("problem", "vehicle", "number"),
    [*PAGES, *(pytest.param(*page, marks=pytest.mark.slow) for page in OTHERS)],
)
def test_no_text_lies_over_another_or_beyond_the_page(problem, vehicle, number, monkeypatch):
    require_legible(shared_page(problem, vehicle, number), monkeypatch)


@pytest.mark.parametrize(("problem", "vehicle", "number"), PAGES)
def test_every_axis_says_its_quantity_and_unit(problem, vehicle, number):
    for axes in shared_page(problem, vehicle, number).axes:
        if not axes.axison:
            assert {f"{name} [m]" for name in "xyz"} <= {text.get_text() for text in axes.texts}
            continue
        assert "[" in axes.get_ylabel()
        numbers = axes.xaxis.get_tick_params()["labelbottom"]
        assert not numbers or "[" in axes.get_xlabel()


def test_a_page_is_a_picture_1600_pixels_wide():
    content = png(shared_page("flip-roll"))
    assert content.startswith(b"\x89PNG")
    assert 1600 <= int.from_bytes(content[16:20], "big") <= 1620


def test_drawn_errors_are_those_of_the_flight():
    flight = simulated("flip-roll")
    figure = shared_page("flip-roll")
    distance = np.linalg.norm(flight.states.position - flight.setpoint.flat.position, axis=1)
    position = panel_of(figure, "position error")
    unit = {"[m]": 1.0, "[cm]": 1e-2}[position.get_ylabel().split()[-1]]
    times, drawn = position.get_lines()[0].get_data()
    np.testing.assert_allclose(times, flight.times)
    np.testing.assert_allclose(unit * np.asarray(drawn), distance, rtol=1e-12)
    relative = so3.multiply(so3.conjugate(flight.setpoint.q_world_body), flight.states.q_world_body)
    angle = 2 * np.arctan2(np.linalg.norm(relative[:, 1:], axis=1), np.abs(relative[:, 0]))
    drawn = panel_of(figure, "attitude error").get_lines()[0].get_ydata()
    np.testing.assert_allclose(drawn, np.rad2deg(angle), atol=1e-6)


@pytest.mark.parametrize("vehicle", ["agile-quad", pytest.param("hexarotor", marks=pytest.mark.slow)])
def test_rotor_thrusts_are_drawn_with_the_vehicle_s_limits(vehicle):
    flight, body = simulated("flip-roll", vehicle), ab.load_vehicle(vehicle)
    lines = panel_of(shared_page("flip-roll", vehicle), "rotor thrust").get_lines()
    rotors, limits = lines[: len(body.rotors)], lines[len(body.rotors) :]
    for i, line in enumerate(rotors):
        np.testing.assert_allclose(line.get_ydata(), flight.thrusts[:, i])
    assert {line.get_ydata()[0] for line in limits} == {
        *body.min_thrusts.tolist(),
        *body.max_thrusts.tolist(),
    }
    assert all(line.get_linestyle() == "--" for line in limits)


def test_stages_are_marked_at_their_times_in_every_timeline():
    plan = shared_plan("flip-roll")
    figure = shared_page("flip-roll")
    for quantity in ("position error", "attitude error", "specific thrust", "rotor thrust"):
        marks = panel_of(figure, quantity).collections[0].get_segments()
        np.testing.assert_allclose([mark[0][0] for mark in marks], [stage.time for stage in plan.stages])


@pytest.mark.parametrize(
    "problem", [PROBLEMS[0], *(pytest.param(name, marks=pytest.mark.slow) for name in PROBLEMS[1:])]
)
def test_arrows_are_the_specific_thrust_at_the_scale_of_their_keys(problem):
    plan, vehicle = shared_plan(problem), ab.load_vehicle("agile-quad")
    axes = stages_panel(shared_page(problem))
    quivers = {q.get_facecolor()[0].tobytes(): q for q in axes.collections if isinstance(q, Quiver)}
    keys = {key.Q: key for key in axes.get_children() if isinstance(key, QuiverKey)}
    reference = plan_keyframes(plan, vehicle)
    plane = maneuver_plane(plan, reference.thrust)
    for colour, column in ((SKY, 0), (BLUE, 1)):
        quiver = quivers[np.array(to_rgba(colour)).tobytes()]
        value = float(keys[quiver].label.split()[-2])
        drawn = (quiver.U, quiver.V)[column] * value / keys[quiver].U
        expected = plane.camera.project(reference.thrust)[:, column]
        for place, thrust in zip(quiver.get_offsets(), drawn, strict=True):
            k = np.linalg.norm(plane.camera.project(reference.position) - place, axis=1).argmin()
            assert thrust == pytest.approx(expected[k], abs=1e-6)


def pixels_of(picture, colour):
    """How many pixels are of a colour, or of one that nobody tells from it."""
    return int((np.abs(picture - 255 * np.array(to_rgba(colour)[:3])).max(axis=-1) < 12).sum())


@pytest.mark.parametrize(("problem", "vehicle", "number"), PAGES)
def test_nothing_is_red_where_nothing_is_wrong(problem, vehicle, number):
    canvas = shared_page(problem, vehicle, number).canvas
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    assert pixels_of(picture, RED) == 0
    assert number > 0 or pixels_of(picture, BLUE) > 100


def test_stages_may_come_in_any_order():
    plan = shared_plan("flip-roll")
    disordered = replace(plan, stages=plan.stages[::-1])
    one, other = (
        stages_panel(report_figure(p, ab.load_vehicle("agile-quad"))).texts for p in (plan, disordered)
    )
    assert sorted(text.get_text() for text in one) == sorted(text.get_text() for text in other)


def test_a_hover_is_drawn_like_any_other_plan():
    spot = ab.at_rest([1.0, 2.0, 3.0])
    hover = replace(ab.load_problem("line"), start=spot, goal=spot)
    vehicle = ab.load_vehicle("agile-quad")
    plan = ab.plan(hover, ab.MinSnap(), vehicle)
    assert png(report_figure(plan, vehicle, ab.fly(plan.trajectory, vehicle)))


def test_all_stages_are_drawn_where_they_are_planned():
    plan = shared_plan("flip-pitch")
    axes = stages_panel(shared_page("flip-pitch"))
    assert axes.get_xlabel() == "x [m]"
    assert axes.get_aspect() == "auto"
    assert {stage.name for stage in plan.stages} <= {text.get_text() for text in axes.texts}
    quiver = next(q for q in axes.collections if isinstance(q, Quiver))
    expected = [plan.trajectory.evaluate(stage.time)[[0, 2]] for stage in plan.stages]
    np.testing.assert_allclose(quiver.get_offsets(), expected, atol=1e-9)
    size = axes.figure.get_size_inches() * axes.get_position().size
    assert np.ptp(axes.get_xlim()) / size[0] == pytest.approx(np.ptp(axes.get_ylim()) / size[1])


@given(st.floats(-720.0, 720.0))
def test_the_plane_of_a_flip_is_square_to_its_axis(axis_deg):
    plan = shared_plan("flip-roll")
    plan = replace(plan, problem=replace(plan.problem, maneuver=ab.Flip(axis_deg=axis_deg)))
    plane = maneuver_plane(plan, np.zeros((3, 3)))
    axis = np.array([np.cos(np.deg2rad(axis_deg)), np.sin(np.deg2rad(axis_deg)), 0.0])
    lateral, up = plane.camera.screen
    np.testing.assert_allclose([lateral @ axis, up[2]], [0.0, 1.0], atol=1e-9)


@given(st.floats(-180.0, 180.0), st.integers(0, 1000))
def test_any_other_plane_is_where_the_thrust_moves_most(heading_deg, seed):
    rng = np.random.default_rng(seed)
    along = np.array([np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg)), 0.0])
    thrust = np.outer(rng.uniform(-20, 20, 6), along) + rng.uniform(-0.1, 0.1, (6, 3))
    plane = maneuver_plane(shared_plan("line"), thrust)
    assert abs(plane.camera.screen[0] @ along) > np.cos(np.deg2rad(9.0))


def test_vehicles_along_the_path_stand_as_the_flight_stood(monkeypatch):
    painted = []
    monkeypatch.setattr(path_panel, "draw_depth_sorted", lambda axes, shapes, camera: painted.extend(shapes))
    flight, gate = simulated("flip-roll"), shared_plan("flip-roll").problem.gates[0]
    page("flip-roll")
    axes = [shape.points for shape in painted if len(shape.points) == 2 and shape.width == 0.9]
    assert len(axes) >= 10
    times = []
    for foot, tip in axes:
        k = np.linalg.norm(flight.states.position - foot, axis=1).argmin()
        np.testing.assert_allclose(foot, flight.states.position[k])
        upward = so3.thrust_axis(flight.states.q_world_body[k])
        np.testing.assert_allclose((tip - foot) / np.linalg.norm(tip - foot), upward, atol=1e-9)
        times.append(flight.times[k])
    steps = np.diff(times) / (shared_plan("flip-roll").duration / path_panel.POSES)
    np.testing.assert_allclose(steps, np.round(steps), atol=0.1)  # whole steps, to a row of the flight
    assert min(np.linalg.norm(foot - gate.position) for foot, _ in axes) < 0.05  # one of them in the gate


def test_vehicles_in_gates_do_not_cover_each_other(monkeypatch):
    plan, quad, scales = shared_plan("line"), ab.load_vehicle("agile-quad"), []
    monkeypatch.setattr(
        path_panel, "pose_shapes", lambda vehicle, position, q, scale, camera: scales.append(scale) or []
    )
    gates = tuple(ab.tilted_gate((x, 0.0, 0.0), name=f"{x:g}") for x in np.arange(1.0, 9.0, 0.8))
    course = replace(plan, problem=replace(plan.problem, gates=gates), stages=())
    poses = reference_poses(plan_reference(plan, quad))
    path_panel.draw_path(Figure().add_subplot(), Subject(course, course, quad), poses, [])
    assert max(scales) * span(quad) < 0.8


def test_a_batch_of_flights_is_drawn_whole():
    batch = batch_of("flip-roll", 7)
    figure = draw(batch, shared_plan("flip-roll"))
    assert any("7 flights" in text.get_text() for text in figure.texts)
    axes = panel_of(figure, "position error")
    bundle = next(c for c in axes.collections if len(c.get_segments()) == 7)
    unit = {"[m]": 1.0, "[cm]": 1e-2}[axes.get_ylabel().split()[-1]]
    distances = np.linalg.norm(batch.states.position - batch.setpoint.flat.position, axis=-1)
    for segment, distance in zip(bundle.get_segments(), distances, strict=True):
        np.testing.assert_allclose(unit * segment[:, 1], distance, rtol=1e-12)


def test_a_flight_that_went_astray_does_not_shrink_the_picture():
    flight = simulated("flip-roll")
    position = flight.states.position.copy()
    position[len(position) // 2 :] += 1000.0
    stray = replace(flight, series={**flight.series, "position": position})
    ordinary, lost = (draw(f, shared_plan("flip-roll")).axes[0].get_ylim() for f in (flight, stray))
    assert np.ptp(lost) < 2.0 * np.ptp(ordinary)


def test_a_flight_can_be_drawn_alone_when_its_vehicle_is_a_preset():
    assert draw(simulated("line")).texts[0].get_text() == "flight of agile-quad"
    stranger = replace(simulated("line"), vehicles=("my-own",))
    with pytest.raises(ab.SpecError, match="my-own"):
        draw(stranger)
    assert draw(stranger, vehicle=ab.load_vehicle("agile-quad")).axes


def test_the_reader_s_own_matplotlib_settings_change_nothing():
    plain = page("line")
    with matplotlib.rc_context({"font.size": 30.0, "axes.labelsize": 30.0, "lines.linewidth": 9.0}):
        before = dict(matplotlib.rcParams)
        styled = page("line")
        assert dict(matplotlib.rcParams) == before
    for one, other in zip(plain.axes, styled.axes, strict=True):
        assert one.yaxis.label.get_size() == other.yaxis.label.get_size()
        assert [line.get_linewidth() for line in one.lines] == [line.get_linewidth() for line in other.lines]


def test_the_same_data_give_the_same_picture():
    assert png(draw(simulated("line"))) == png(draw(simulated("line")))


@pytest.mark.process
def test_drawing_never_imports_pyplot(tmp_path):
    simulated("line").save(tmp_path / "flight.npz")
    code = (
        "import sys, aerobat as ab, aerobat.reporting.figures\n"
        "assert 'matplotlib' not in sys.modules\n"
        "ab.draw(ab.load_flight('flight.npz')).savefig('flight.png')\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


@lru_cache
def two_flips_page():
    plan, flight = two_flips()
    return report_figure(plan, ab.load_vehicle("agile-quad"), flight)


@pytest.mark.slow
def test_stages_are_numbered_where_their_names_have_no_room(monkeypatch):
    plan, _ = two_flips()
    figure = two_flips_page()
    shown = {text.get_text() for text in panel_of(figure, "position error").texts}
    assert {str(k) for k in range(1, 9)} <= shown
    assert not {stage.name for stage in plan.stages} & shown
    require_legible(figure, monkeypatch)


@pytest.mark.parametrize("width", [5.0, 11.0])
@pytest.mark.parametrize("count", [3, 12])
def test_long_names_of_stages_stay_on_the_page_and_apart(width, count, monkeypatch):
    """In tall panels and in wide ones."""
    plan = shared_plan("line")
    times = np.linspace(0.0, plan.duration, count + 2)[1:-1].tolist()
    names = (f"{k} beyond the door of the hall on the left" for k in range(count))
    stages = tuple(
        PlacedStage(name, k, time) for k, (name, time) in enumerate(zip(names, times, strict=True))
    )
    figure = Figure(figsize=(width, 8.0), dpi=DPI)
    FigureCanvasAgg(figure)
    draw_stages(figure.add_subplot(), replace(plan, stages=stages), ab.load_vehicle("agile-quad"))
    require_legible(figure, monkeypatch, fewest=count)


@pytest.mark.slow
@pytest.mark.parametrize("count", [12, 19, 40])
def test_a_course_of_many_stages_is_legible(count, monkeypatch):
    """Of very many some are drawn and numbered, all are marked."""
    plan = shared_plan("flip-roll-translation")
    times = np.linspace(0.0, plan.duration, count + 2)[1:-1].tolist()
    stages = tuple(PlacedStage(f"waypoint {k}", k, time) for k, time in enumerate(times, 1))
    figure = report_figure(replace(plan, stages=stages), ab.load_vehicle("agile-quad"))
    require_legible(figure, monkeypatch)
    note = f"in order but for {count - 11} of {count}"
    assert any(note in text.get_text() for axes in figure.axes for text in axes.texts)


@pytest.mark.slow
def test_every_gate_is_drawn_inside_the_picture_with_a_vehicle_in_it(monkeypatch):
    calls = []
    monkeypatch.setattr(path_panel, "draw_depth_sorted", lambda *call: calls.append(call))
    plan, flight = two_flips()
    draw(flight, plan)
    [(axes, shapes, camera)] = calls
    assert len(plan.problem.gates) == 2
    drawn = np.concatenate([shape.points for shape in shapes])
    low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
    for gate in plan.problem.gates:
        for corner in np.concatenate(gate_bars(gate)).reshape(-1, 3):
            assert np.linalg.norm(drawn - corner, axis=1).min() < 1e-9
            assert (camera.project(corner) > low).all()
            assert (camera.project(corner) < high).all()
        assert np.linalg.norm(drawn - gate.position, axis=1).min() < 0.05  # the foot of a thrust axis


@pytest.mark.slow
def test_every_passage_of_a_gate_is_marked_in_every_timeline():
    plan, _ = two_flips()
    passages = [stage.time for stage in plan.stages if stage.gate is not None]
    assert len(passages) == 2
    figure = two_flips_page()
    for quantity in ("position error", "attitude error", "specific thrust", "rotor thrust"):
        marks = panel_of(figure, quantity).collections[0]
        colours = marks.get_colors()
        times = [
            s[0][0] for s, c in zip(marks.get_segments(), colours, strict=True) if (c == YELLOW_RGBA).all()
        ]
        np.testing.assert_allclose(times, passages)


def test_stages_that_would_cover_each_other_follow_one_another():
    plan, _ = two_flips()
    axes = next(a for a in two_flips_page().axes if a.get_ylabel().startswith("stages in order"))
    quiver = next(q for q in axes.collections if isinstance(q, Quiver))
    per_metre = axes.figure.get_size_inches()[1] * axes.get_position().height / np.ptp(axes.get_ylim())
    assert len(quiver.get_offsets()) == len(plan.stages)
    assert (-np.diff(quiver.get_offsets()[:, 1]) * per_metre > 0.5).all()  # [in] downward in their order
    centres = [np.mean(gate, axis=0) for gate in drawn_gates(axes)]
    passed = [place for place, s in zip(quiver.get_offsets(), plan.stages, strict=True) if s.gate is not None]
    np.testing.assert_allclose(centres, passed, atol=0.05)


@lru_cache
def half_flip_in_a_row():
    """A gentle half-flip, with three stages at one instant as well, which would cover each other."""
    plan = closed_form()
    (gate,) = plan.stages
    return replace(plan, stages=(gate, *(PlacedStage(str(k), k, gate.time) for k in range(3))))


@pytest.mark.parametrize("make", [closed_form, half_flip_in_a_row])
def test_the_stages_show_a_gate_that_moves_where_it_is_passed(make):
    still, moving = (drawn_gates(stages_axes(plan)) for plan in (make(), with_moving_gates(make())))
    assert len(still) == 1
    np.testing.assert_allclose(moving, still, atol=1e-9)


@pytest.mark.parametrize("make", [closed_form, half_flip_in_a_row])
def test_the_stages_show_a_gate_as_far_off_the_vehicle_as_it_is_passed(make):
    plan = make()
    (gate,) = plan.problem.gates
    higher = replace(plan.problem, gates=(replace(gate, position=gate.position + 0.2 * so3.UP),))
    offsets = []
    for axes in map(stages_axes, (plan, replace(plan, problem=higher))):
        (frame,), quiver = drawn_gates(axes), next(q for q in axes.collections if isinstance(q, Quiver))
        distances = frame.mean(axis=0) - quiver.get_offsets()
        offsets.append(distances[np.linalg.norm(distances, axis=1).argmin()])
    np.testing.assert_allclose(offsets[1] - offsets[0], [0.0, 0.2], atol=1e-9)


def test_stages_in_a_row_are_each_shown_in_the_plane_of_their_thrust():
    plan, _ = two_flips()
    vehicle = ab.load_vehicle("agile-quad")
    axes = next(a for a in two_flips_page().axes if a.get_ylabel().startswith("stages in order"))
    quivers = {q.get_facecolor()[0].tobytes(): q for q in axes.collections if isinstance(q, Quiver)}
    level, upward = (quivers[np.array(to_rgba(colour)).tobytes()] for colour in (SKY, BLUE))
    keys = {key.Q: key for key in axes.get_children() if isinstance(key, QuiverKey)}
    scale = float(keys[level].label.split()[-2]) / keys[level].U
    thrust = plan_keyframes(plan, vehicle).thrust
    across = np.linalg.norm(thrust[:, :2], axis=1)
    shown = across > 0.1 * np.linalg.norm(thrust, axis=1)  # a vertical one lies in any plane
    assert shown.sum() >= 4
    np.testing.assert_allclose(np.abs(scale * level.U)[shown], across[shown], rtol=0.01)
    np.testing.assert_allclose(scale * upward.V, thrust[:, 2], atol=1e-9)


def test_a_flight_that_is_over_as_it_begins_is_drawn() -> None:
    """One row, no time and no way between its poses."""
    far_off = ab.Dispersion(name="far off", start_position=50.0)
    flight = ab.fly(shared_plan("line", "agile-quad"), conditions=far_off)
    assert len(flight.times) == 1
    assert png(draw(flight))
