"""Robot descriptions as vehicles: published numbers, laws of rigid bodies, a sentence for nonsense."""

import re
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.errors import SpecError
from aerobat.interchange.robots import import_vehicle, read_robot_description
from aerobat.vehicle import implausibilities, load_vehicle
from places import CASES
from refusals import complaint

ROBOTS = CASES / "robots"
IRIS = (ROBOTS / "iris.sdf").read_text(encoding="utf-8")
CRAZYFLIE = (ROBOTS / "crazyflie.urdf").read_text(encoding="utf-8")
X500 = ROBOTS / "x500" / "model.sdf"


def test_the_iris_has_the_thrusts_and_places_of_its_motor_models() -> None:
    iris = import_vehicle(ROBOTS / "iris.sdf")
    assert iris.mass == pytest.approx(1.5 + 0.015 + 4 * 0.005)
    np.testing.assert_allclose(iris.max_thrusts, 5.84e-6 * 1100**2)
    assert [rotor.spin for rotor in iris.rotors] == [1, 1, -1, -1]
    assert {(r.torque_coefficient, r.lag, r.radius) for r in iris.rotors} == {(0.06, 0.025, 0.128)}
    centre = (0.015 * 0.02 + 4 * 0.005 * 0.023) / iris.mass  # [m] above the middle: the IMU's and the rotors'
    places = np.array([[0.13, -0.22, 0.023], [-0.13, 0.2, 0.023], [0.13, 0.22, 0.023], [-0.13, -0.2, 0.023]])
    np.testing.assert_allclose([r.position_body for r in iris.rotors], places - [0, 0, centre], atol=1e-12)
    hover = np.sqrt(iris.mass * 9.81 / (4 * 5.84e-6))
    np.testing.assert_allclose(iris.drag_body, [4 * 1.75e-4 * hover, 4 * 1.75e-4 * hover, 0.0])
    assert implausibilities(iris) == ()


def test_the_iris_is_planned_for_and_flown() -> None:
    iris = ab.import_vehicle(ROBOTS / "iris.sdf")
    found = ab.plan(ab.load_problem("half-flip"), vehicle=iris)
    assert found.certificate.certified
    assert found.flies


def test_a_model_that_is_merged_from_another_folder_is_one_with_it() -> None:
    x500 = import_vehicle(X500)
    assert x500.name == "x500"
    assert x500.mass == pytest.approx(2.0 + 4 * 0.016076923076923075)
    np.testing.assert_allclose(x500.max_thrusts, 8.54858)
    assert x500.rotors[0].radius == pytest.approx(0.2792307692307692 / 2)


def test_what_a_file_says_nothing_of_is_named_and_its_toml_is_completed_by_hand(tmp_path: Path) -> None:
    found = read_robot_description(ROBOTS / "crazyflie.urdf")
    assert found.missing == ("spin", "lag")
    with pytest.raises(
        SpecError, match=r"^robot file .*crazyflie.urdf: nothing is said of the rotors' spin, lag;"
    ):
        import_vehicle(ROBOTS / "crazyflie.urdf")
    spins = iter([-1, 1, -1, 1])
    text = re.sub(r"(\[\[rotors]]\n)", lambda head: f"{head[1]}spin = {next(spins)}\n", found.toml())
    file = tmp_path / "crazyflie.toml"
    file.write_text(text.replace("[rotor_defaults]", "[rotor_defaults]\nlag = 0.03"), encoding="utf-8")
    crazyflie = load_vehicle(file)
    assert crazyflie.thrust_to_weight == pytest.approx(2.25)
    assert crazyflie.rotors[0].torque_coefficient == pytest.approx(7.94e-12 / 3.16e-10)
    np.testing.assert_allclose(crazyflie.rotors[0].position_body, [0.028, -0.028, 0.0])


def test_an_imported_vehicle_survives_its_toml_file(tmp_path: Path) -> None:
    for source in (ROBOTS / "iris.sdf", X500):
        (tmp_path / "mine.toml").write_text(read_robot_description(source).toml(), encoding="utf-8")
        assert load_vehicle(tmp_path / "mine.toml") == import_vehicle(source)


def urdf(rng: np.random.Generator, links: int) -> str:
    """A tree of links at random places, each a cloud of masses, with four propellers on the first."""
    parts = []
    for i in range(links):
        cloud = rng.normal(size=(6, 3)) * 0.05
        masses = rng.uniform(0.01, 0.1, 6)
        centre = masses @ cloud / masses.sum()
        arms = cloud - centre
        j = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
        parts.append(
            f'<link name="part{i}"><inertial><origin xyz="{centre[0]} {centre[1]} {centre[2]}"/>'
            f'<mass value="{masses.sum()}"/><inertia ixx="{j[0, 0]}" iyy="{j[1, 1]}" izz="{j[2, 2]}" '
            f'ixy="{j[0, 1]}" ixz="{j[0, 2]}" iyz="{j[1, 2]}"/></inertial></link>'
        )
        if i:
            xyz, rpy = (" ".join(map(repr, rng.normal(size=3).tolist())) for _ in range(2))
            parts.append(
                f'<joint name="joint{i}" type="fixed"><parent link="part{rng.integers(i)}"/>'
                f'<child link="part{i}"/><origin xyz="{xyz}" rpy="{rpy}"/></joint>'
            )
    for k, (x, y) in enumerate([(1, 1), (1, -1), (-1, -1), (-1, 1)]):
        parts.append(
            f'<link name="rotor{k}"/><joint name="turn{k}" type="continuous"><parent link="part0"/>'
            f'<child link="rotor{k}"/><origin xyz="{x} {y} 0.1"/></joint>'
        )
    return f'<robot name="random">{"".join(parts)}</robot>'


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_links_at_any_pose_have_the_mass_centre_and_inertia_that_mujoco_finds(
    tmp_path_factory: pytest.TempPathFactory, seed: int, links: int
) -> None:
    text = urdf(np.random.default_rng(seed), links)
    path = tmp_path_factory.getbasetemp() / "random.urdf"
    path.write_text(text, encoding="utf-8")
    table = read_robot_description(path).table
    option = (
        '<mujoco><compiler fusestatic="false" balanceinertia="false" discardvisual="false"/></mujoco></robot>'
    )
    massive = re.sub(r'<link name="rotor\d"/><joint .*?</joint>', "", text)
    model = mujoco.MjModel.from_xml_string(massive.replace("</robot>", option))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = model.body_mass[1:]
    places = data.xipos[1:]
    centre = mass @ places / mass.sum()
    inertia = np.zeros((3, 3))
    for m, place, moments, axes in zip(mass, places, model.body_inertia[1:], data.ximat[1:], strict=True):
        R, arm = axes.reshape(3, 3), place - centre
        inertia += R @ np.diag(moments) @ R.T + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    assert table["mass"] == pytest.approx(mass.sum())
    np.testing.assert_allclose(table["centre_of_mass"], centre, rtol=0, atol=1e-9)
    np.testing.assert_allclose(table["inertia"], inertia, rtol=0, atol=1e-9)


def test_a_pose_relative_to_another_is_that_one_and_then_this(tmp_path: Path) -> None:
    """A rotor at another place of a frame that is turned by 90° and raised stands where it stood."""
    turned = IRIS.replace(
        '<link name="rotor_0">\n      <pose>', '<link name="rotor_0">\n      <pose relative_to="f">'
    )
    turned = turned.replace("0.13 -0.22 0.023 0 0 0", "-0.22 -0.13 -0.477 0 0 0 ")
    turned = turned.replace(
        '<model name="iris">',
        '<model name="iris"><frame name="f"><pose degrees="true">0 0 0.5 0 0 90</pose></frame>',
    )
    (tmp_path / "turned.sdf").write_text(turned, encoding="utf-8")
    found = read_robot_description(tmp_path / "turned.sdf").table["rotors"][0]["position_body"]
    np.testing.assert_allclose(found, [0.13, -0.22, 0.023], atol=1e-12)


def test_an_axis_is_that_of_the_frame_it_is_given_in(tmp_path: Path) -> None:
    """A joint that lies on its side in its child's frame turns about its own x, which points up."""
    lying = IRIS.replace(
        '<joint name="rotor_0_joint" type="revolute">',
        '<joint name="rotor_0_joint" type="revolute"><pose degrees="true">0 0 0 0 -90 0</pose>',
    )
    path = tmp_path / "lying.sdf"
    for axis in (
        "<xyz>1 0 0</xyz>",
        '<xyz expressed_in="__model__">0 0 1</xyz>',
        "<xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame>",
    ):
        path.write_text(lying.replace("<xyz>0 0 1</xyz>", axis, 1), encoding="utf-8")
        assert import_vehicle(path).mass == pytest.approx(1.535)
    path.write_text(lying, encoding="utf-8")
    assert "the rotor 'rotor_0' is tilted by 90°" in complaint(lambda: import_vehicle(path))


MALFORMED = {
    "empty": (IRIS, IRIS, "", "this is not valid XML: no element found"),
    "cut off": (IRIS, "</model>\n</sdf>", "", "this is not valid XML: "),
    "another root": (IRIS, "sdf", "world", "its root is <world>; a URDF's is <robot>"),
    "entities": (
        IRIS,
        "<sdf ",
        '<!DOCTYPE s [<!ENTITY a "b">]><sdf ',
        "this is XML with a document type declaration",
    ),
    "a macro": (CRAZYFLIE, "<properties", "<xacro:property", "this is a xacro macro; expand it first"),
    "a template": (IRIS, "1.5<", "{{ mass }}<", "this is a template"),
    "two models": (IRIS, "</model>", '</model><model name="b"/>', "must hold one model, got 2"),
    "no mass": (CRAZYFLIE, 'mass value="0.027"', 'mass value="0"', "no link has a mass"),
    "a negative mass": (
        IRIS,
        "<mass>1.5<",
        "<mass>-1.5<",
        "link 'base_link': mass must be 0 or more, got -1.5",
    ),
    "a mass in words": (
        IRIS,
        "<mass>1.5<",
        "<mass>1.5 kg<",
        "link 'base_link': mass must be a finite number",
    ),
    "a mass without end": (
        IRIS,
        "<mass>1.5<",
        "<mass>inf<",
        "link 'base_link': mass must be a finite number",
    ),
    "a short pose": (
        IRIS,
        "0.13 -0.22 0.023 0",
        "0.13 -0.22",
        "link 'rotor_0': pose must be 6 finite numbers",
    ),
    "a tilted rotor": (
        IRIS,
        "0.13 -0.22 0.023 0 0 0",
        "0 0 0 0 0.3 0",
        "the rotor 'rotor_0' is tilted by 17.2°",
    ),
    "a rotor that turns about another axis": (
        IRIS,
        "<axis><xyz>0 0 1</xyz></axis>",
        "<axis><xyz>0 1 1</xyz></axis>",
        "the rotor 'rotor_0' is tilted by 45°",
    ),
    "an axis of another frame": (
        IRIS,
        "<axis><xyz>0 0 1</xyz></axis>",
        '<axis><xyz expressed_in="x">0 0 1</xyz></axis>',
        "a pose is relative to 'x', which is not",
    ),
    "an axis without numbers": (
        IRIS,
        "<axis><xyz>0 0 1</xyz></axis>",
        "<axis><xyz>nan 0 1</xyz></axis>",
        "joint 'rotor_0_joint': axis must be 3 finite numbers",
    ),
    "an axis without direction": (
        IRIS,
        "<axis><xyz>0 0 1</xyz></axis>",
        "<axis><xyz>0 0 0</xyz></axis>",
        "joint 'rotor_0_joint': axis must have a direction, got '0 0 0'",
    ),
    "a joint about another axis": (
        CRAZYFLIE,
        'type="fixed"><parent link="base_link"/><child link="prop3_link"/>',
        'type="continuous"><axis xyz="1 0 0"/><parent link="base_link"/><child link="prop3_link"/>',
        "the rotor 'prop3_link' is tilted by 90°",
    ),
    "a base that is not weighed": (
        CRAZYFLIE,
        '<mass value="0.027"/>',
        "",
        "link 'base_link': its <inertial> has no <mass>",
    ),
    "a mass without a value": (
        CRAZYFLIE,
        '<mass value="0.027"/>',
        "<mass/>",
        "link 'base_link': its <inertial> has no <mass>",
    ),
    "a model that is not weighed": (
        IRIS,
        "<mass>1.5</mass>",
        "",
        "link 'base_link': its <inertial> has no <mass>",
    ),
    "a crowd": (
        IRIS,
        "</model>",
        "".join(f'<link name="part{k}"/>' for k in range(1000)) + "</model>",
        "it has more than 1000 links, joints and frames",
    ),
    "a lost frame": (
        IRIS,
        "<pose>0.13",
        '<pose relative_to="x">0.13',
        "a pose is relative to 'x', which is not",
    ),
    "a circle": (
        IRIS,
        "<pose>0.13 -",
        '<pose relative_to="rotor_0">0.13 -',
        "the pose of 'rotor_0' is relative to its",
    ),
    "a twin": (
        IRIS,
        'link name="imu_link"',
        'link name="base_link"',
        "two of its elements are named 'base_link'",
    ),
    "no name": (IRIS, 'link name="imu_link"', "link", "a link has no name"),
    "no direction": (IRIS, ">ccw<", ">left<", "motor model of 'rotor_0': turningDirection must be ccw or cw"),
    "no constant": (
        IRIS,
        ">5.84e-06<",
        "><",
        "motor model of 'rotor_0': motorConstant must be positive, got 0",
    ),
    "a lost rotor": (
        IRIS,
        "<linkName>rotor_0",
        "<linkName>r",
        "a motor model turns the link 'r', which is not there",
    ),
    "a lost include": (
        IRIS,
        "<include>",
        '<include merge="true">',
        "it includes 'model://gps', which is not at ",
    ),
    "no rotors": (CRAZYFLIE, "prop", "part", "it has no motor model, and no link is named after a rotor"),
    "two roots": (
        CRAZYFLIE,
        "</robot>",
        '<link name="alone"/></robot>',
        "one link must be the root of the others, got 'base_link' and 'alone'",
    ),
    "a circle of joints": (
        CRAZYFLIE,
        '<parent link="base_link"/><child link="prop0_link"/>',
        '<parent link="base_link"/><child link="base_link"/>',
        "link 'base_link' hangs on itself by its joints",
    ),
    "a lost link": (
        CRAZYFLIE,
        '<child link="prop0_link"/>',
        '<child link="x"/>',
        "joint 'prop0_joint' names the link",
    ),
    "no child": (CRAZYFLIE, '<child link="prop0_link"/>', "", "joint 'prop0_joint' names no child link"),
}


@pytest.mark.parametrize("fault", MALFORMED)
def test_a_malformed_description_is_one_sentence_that_names_the_element(fault: str, tmp_path: Path) -> None:
    text, old, new, expected = MALFORMED[fault]
    assert old in text
    path = tmp_path / "mine.sdf"
    path.write_text(text.replace(old, new), encoding="utf-8")
    said = complaint(lambda: import_vehicle(path))
    assert said.partition("mine.sdf: ")[2].startswith(expected)
    assert said.isprintable()


@given(st.sampled_from([IRIS, CRAZYFLIE]), st.data())
def test_a_description_spoilt_anywhere_is_read_or_is_one_sentence(
    tmp_path_factory: pytest.TempPathFactory, text: str, data: st.DataObject
) -> None:
    junk = st.sampled_from(["", "<", ">", '"', "/", "-", "1e300", "nan", "é", "\0", "rotor_1", " 3 3 3"])
    at, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 30))
    spoilt = text[:at] + data.draw(junk) + text[at + length :]
    path = tmp_path_factory.getbasetemp() / "spoilt.sdf"
    path.write_text(spoilt, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert complaint(lambda: import_vehicle(path)).isprintable()
