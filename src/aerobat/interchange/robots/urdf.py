"""Robots in URDF: a tree of links and joints, all joints at zero."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.interchange.robots.body import IDENTITY, MOMENTS, Link, RigidTransform, Robot, link_of
from aerobat.interchange.robots.markup import by_name, collision_radius, direction, name_of, numbers
from aerobat.interchange.robots.motors import read_motors

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


def read_urdf(root: Element, path: Path) -> Robot:
    """Return the robot under a URDF file's root, in the frame of its root link.

    The `<properties>` of gym-pybullet-drones, thrust2weight, kf, km and prop_radius, are read too. Raises
    SpecError, naming the link or the joint, for a malformed file.
    """
    elements = by_name(root.findall("link"))
    poses = _poses(root, elements)
    joints = {_end(joint, "child"): joint for joint in by_name(root.findall("joint")).values()}
    links = tuple(_link(name, each, poses[name], joints.get(name)) for name, each in elements.items())
    defaults = _properties(root.find("properties"))
    children = {name_of(joint, "joint"): child for child, joint in joints.items()}
    notes = tuple(
        f"link '{name}' has no <inertial>: taken as massless"
        for name, each in elements.items()
        if each.find("inertial") is None
    )
    return Robot(root.get("name") or path.stem, links, read_motors(root, children), defaults, notes)


def _poses(root: Element, links: dict[str, Element]) -> dict[str, RigidTransform]:
    """Return the frames of all links in that of the root, by the joints between."""
    above: dict[str, tuple[str, RigidTransform]] = {}
    for joint in root.findall("joint"):
        name, parent, child = name_of(joint, "joint"), _end(joint, "parent"), _end(joint, "child")
        for end in (parent, child):
            if end not in links:
                raise SpecError(f"joint '{name}' names the link '{end}', which is not there")
        if child in above:
            raise SpecError(f"link '{child}' hangs on two joints, '{name}' among them")
        above[child] = parent, _origin(joint, f"joint '{name}'")
    roots = [name for name in links if name not in above]
    if len(roots) != 1:
        which = " and ".join(f"'{name}'" for name in roots[:2]) or "none"
        raise SpecError(f"one link must be the root of the others, got {which}; join them")
    parents = {child: [parent] for child, (parent, _) in above.items()}
    try:
        parents_first = [*TopologicalSorter(parents).static_order()]
    except CycleError as error:
        raise SpecError(f"link '{error.args[1][0]}' hangs on itself by its joints") from None
    poses = {roots[0]: IDENTITY}
    for name in parents_first:
        if name in above:
            parent, joint_frame = above[name]
            poses[name] = poses[parent].then(joint_frame)
    return poses


def _link(name: str, element: Element, pose: RigidTransform, joint: Element | None) -> Link:
    radius = collision_radius(element, name, lambda each, key: each.get(key))
    axis = None if joint is None else _axis(joint, pose)
    inertial = element.find("inertial")
    if inertial is None:
        return link_of(name, pose, radius, axis)
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or not mass.get("value", "").strip():
        raise SpecError(f"link '{name}': its <inertial> has no <mass>; give its value in kg")
    moments = [_attribute(inertia, key, f"link '{name}': inertia") for key in MOMENTS]
    origin = _origin(inertial, f"link '{name}': inertial")
    kilograms = _attribute(mass, "value", f"link '{name}': mass")
    return link_of(name, pose, radius, axis, origin, kilograms, moments)


def _axis(joint: Element, pose: RigidTransform) -> Array | None:
    """Return the axis of a turning joint, whose frame is its child's, at `pose` in that of the root."""
    axis = joint.find("axis")
    if axis is None or joint.get("type") == "fixed":
        return None
    found = direction(axis.get("xyz"), f"joint '{joint.get('name')}': axis")
    return None if found is None else pose.rotation @ found


def _origin(element: Element, what: str) -> RigidTransform:
    origin = element.find("origin")
    if origin is None:
        return IDENTITY
    places: list[Array] = [numbers(origin.get(key), 3, f"{what}: origin {key}") for key in ("xyz", "rpy")]
    return RigidTransform.of(*places)


def _attribute(element: Element | None, key: str, what: str) -> float:
    return 0.0 if element is None else float(numbers(element.get(key), 1, f"{what} {key}")[0])


def _end(joint: Element, which: str) -> str:
    found = joint.find(which)
    link = "" if found is None else found.get("link", "").strip()
    if not link:
        raise SpecError(f"joint '{name_of(joint, 'joint')}' names no {which} link")
    return link


def _properties(element: Element | None) -> dict[str, float]:
    """Return the properties of all rotors by gym-pybullet-drones; the thrust is a ratio to the weight."""
    if element is None:
        return {}
    found = {
        key: _attribute(element, key, "properties") for key in ("thrust2weight", "kf", "km", "prop_radius")
    }
    given = {"thrust_to_weight": found["thrust2weight"], "radius": found["prop_radius"]}
    if found["kf"] > 0.0:
        given["torque_coefficient"] = found["km"] / found["kf"]
    return {key: value for key, value in given.items() if value > 0.0}
