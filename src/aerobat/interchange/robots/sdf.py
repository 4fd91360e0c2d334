"""Robots in SDF: links at poses, given relative to the model or to each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.interchange.robots.body import IDENTITY, MOMENTS, Link, RigidTransform, Robot, link_of
from aerobat.interchange.robots.markup import (
    by_name,
    child_number,
    collision_radius,
    direction,
    name_of,
    numbers,
    parse_xml,
)
from aerobat.interchange.robots.motors import read_motors

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

FRAMES = ("link", "joint", "frame")  # elements that a pose may be relative to
MODEL_FRAME = "__model__"


def read_sdf(root: Element, path: Path) -> Robot:
    """Return the only model under an SDF file's root, in the model's frame.

    A model that is included with merge="true" is part of it; its folder must lie beside that of the file, as
    for Gazebo's model://NAME. Raises SpecError, naming the link, for a malformed file.
    """
    models = [*root.findall("model"), *root.findall("world/model")]
    if len(models) != 1:
        raise SpecError(f"must hold one model, got {len(models)}; give the file of the vehicle itself")
    model = models[0]
    parts = [model, *_merged(model, path)]
    frames = by_name(each for part in parts for tag in FRAMES for each in part.findall(tag))
    axes = _axes(frames)
    elements = [each for part in parts for each in part.findall("link")]
    links, notes = [], []
    for element in elements:
        name = name_of(element, "link")
        if element.find("inertial") is None:
            notes.append(f"link '{name}' has no <inertial>: taken as massless, by Gazebo as 1 kg")
        links.append(_link(name, element, _pose_of(name, frames), axes.get(name)))
    inner = [name_of(each, "model") for each in model.findall("model")]
    inner += [_uri(each) for each in model.findall("include") if not _is_merged(each)]
    notes += [f"'{name}', a model within the model, is left out" for name in inner]
    children = {
        name_of(j, "joint"): (j.findtext("child") or "").strip() for p in parts for j in p.findall("joint")
    }
    motors = tuple(motor for part in parts for motor in read_motors(part, children))
    return Robot(name_of(model, "model"), tuple(links), motors, {}, tuple(notes))


def _merged(model: Element, path: Path) -> list[Element]:
    """Return the models that are merged into this one, without models that these merge."""
    found = []
    for include in filter(_is_merged, model.findall("include")):
        uri = _uri(include)
        name = uri.removeprefix("model://").strip("/")
        file = path.resolve().parent.parent / name / "model.sdf"
        if not uri.startswith("model://") or not file.is_file():
            raise SpecError(
                f"it includes {uri!r}, which is not at {file}; put that model's folder beside its own"
            )
        inner = parse_xml(file).find("model")
        if inner is None:
            raise SpecError(f"it includes {uri!r}, which holds no model")
        found.append(inner)
    return found


def _is_merged(include: Element) -> bool:
    """Return True for a model that becomes part of this one; others are held by joints."""
    return include.get("merge") in ("true", "1")


def _uri(include: Element) -> str:
    return (include.findtext("uri") or "").strip()


def _axes(frames: dict[str, Element]) -> dict[str, Array]:
    """Return the axes of turning joints, in the model's frame, by the names of the links that they turn."""
    found = {}
    for name, joint in frames.items():
        axis = joint.find("axis") if joint.tag == "joint" and joint.get("type") != "fixed" else None
        given = None if axis is None else direction(axis.findtext("xyz"), f"joint '{name}': axis")
        if axis is None or given is None:
            continue
        frame = axis.find("xyz[@expressed_in]")
        reference = name if frame is None else frame.get("expressed_in", name)
        if (axis.findtext("use_parent_model_frame") or "").strip() in ("true", "1"):  # of SDF 1.4 to 1.6
            reference = MODEL_FRAME
        child = (joint.findtext("child") or "").strip()
        found[child] = _pose_of(reference, frames).rotation @ given
    return found


def _link(name: str, element: Element, pose: RigidTransform, axis: Array | None) -> Link:
    radius = collision_radius(element, name, lambda each, key: each.findtext(key))
    inertial = element.find("inertial")
    if inertial is None:
        return link_of(name, pose, radius, axis)
    inertia = inertial.find("inertia")
    what = f"link '{name}'"
    if not (inertial.findtext("mass") or "").strip():
        raise SpecError(f"{what}: its <inertial> has no <mass>; give it in kg")
    moments = [0.0 if inertia is None else child_number(inertia, key, what) for key in MOMENTS]
    mass = child_number(inertial, "mass", what)
    return link_of(name, pose, radius, axis, _pose(inertial, what), mass, moments)


def _pose(element: Element, what: str) -> RigidTransform:
    """Return the pose in an element, relative to its reference frame."""
    pose = element.find("pose")
    if pose is None:
        return IDENTITY
    if pose.get("rotation_format", "euler_rpy") != "euler_rpy":
        raise SpecError(f"{what}: its pose is no roll, pitch and yaw; write it as euler_rpy")
    values = numbers(pose.text, 6, f"{what}: pose")
    angles = np.radians(values[3:]) if pose.get("degrees") in ("true", "1") else values[3:]
    return RigidTransform.of(values[:3], angles)


def _pose_of(name: str, frames: dict[str, Element]) -> RigidTransform:
    """Return the pose of a link, joint or frame in the model's frame, by the chain of reference frames."""
    chain: list[Element] = []
    while name != MODEL_FRAME:
        if name not in frames:
            raise SpecError(f"a pose is relative to '{name}', which is not there")
        if frames[name] in chain:
            raise SpecError(f"the pose of '{name}' is relative to itself")
        chain.append(frames[name])
        name = _reference_frame(frames[name])
    found = IDENTITY
    for element in reversed(chain):
        found = found.then(_pose(element, f"{element.tag} '{element.get('name')}'"))
    return found


def _reference_frame(element: Element) -> str:
    """Return the reference frame of an element's pose: by default the model's, for a joint its child's."""
    pose = element.find("pose")
    given = "" if pose is None else pose.get("relative_to", "")
    usual = (element.findtext("child") or "") if element.tag == "joint" else element.get("attached_to", "")
    return given.strip() or usual.strip() or MODEL_FRAME
