"""XML as robots are described in: read whole, without entities, its numbers checked.

Python's own parser does it. What makes XML from strangers dangerous, entities that grow or name other files,
stands in a document type declaration, which neither format has: a file with one is refused. Libraries for
URDF and SDF bring meshes, lxml or a simulator along for what are a few elements here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.documents import read_text
from aerobat.errors import SpecError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

SUFFIXES = (".urdf", ".sdf", ".xml")  # of files that describe robots
MAX_ELEMENTS = 1000  # in a chain of so many, poses take two seconds
SIGNS = {  # of files from which others are made, and the remedy
    "xacro:": "a xacro macro; expand it first: xacro FILE > FILE.urdf",
    "{{": "a template; let its program write the file first",
    "{%": "a template; let its program write the file first",
    "<!DOCTYPE": "XML with a document type declaration; remove it",
    "<!ENTITY": "XML with entities of its own; write them out",
}


def parse_xml(path: Path) -> Element:
    """Return the root of an XML file. Raises SpecError, one sentence, for any other file."""
    from xml.etree import ElementTree

    text = read_text(path)
    for sign, what in SIGNS.items():
        if sign in text:
            raise SpecError(f"this is {what}")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise SpecError(f"this is not valid XML: {error}") from None


def numbers(text: str | None, count: int, what: str) -> Array:
    """Numbers with spaces between, (count,); zeros for no text. Raises SpecError, naming `what`."""
    words = (text or "").split()
    if not words:
        return np.zeros(count)
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = []
    if len(found) != count or not all(map(isfinite, found)):
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        raise SpecError(f"{what} must be {wanted}, got {' '.join(words)[:60]!r}")
    return np.array(found)


def direction(text: str | None, what: str) -> Array | None:
    """The unit vector (3,) along three numbers; None for no text. Raises SpecError, naming `what`."""
    if not (text or "").split():
        return None
    vector = numbers(text, 3, what)
    if not vector.any():
        raise SpecError(f"{what} must have a direction, got {' '.join((text or '').split())[:60]!r}")
    scaled = vector / np.abs(vector).max()
    return np.asarray(scaled / np.linalg.norm(scaled))


def child_number(element: Element, tag: str, what: str) -> float:
    """The number in a child element, 0 where there is none."""
    return float(numbers(element.findtext(tag), 1, f"{what}: {tag}")[0])


def collision_radius(link: Element, name: str, text_of: Callable[[Element, str], str | None]) -> float | None:
    """The radius [m] of the cylinder that collides, or half the longer side of the box; None without either.

    Args:
        link: The link's element.
        name: The link's name.
        text_of: Gives what an element says under a key: its child's text in SDF, its attribute in URDF.
    """
    for cylinder in link.iterfind("collision/geometry/cylinder"):
        return float(numbers(text_of(cylinder, "radius"), 1, f"link '{name}': cylinder radius")[0])
    for box in link.iterfind("collision/geometry/box"):
        return float(numbers(text_of(box, "size"), 3, f"link '{name}': box size")[:2].max()) / 2
    return None


def by_name(elements: Iterable[Element]) -> dict[str, Element]:
    """Elements by their names.

    Raises SpecError where one has none, two of a kind have the same, or there are more than a robot has.
    """
    found: dict[str, Element] = {}
    for element in elements:
        name = name_of(element, element.tag)
        if name in found:
            raise SpecError(f"two of its elements are named '{name}', a {element.tag} among them; rename one")
        found[name] = element
        if len(found) > MAX_ELEMENTS:
            raise SpecError(f"it has more than {MAX_ELEMENTS} links, joints and frames; join those that hold")
    return found


def name_of(element: Element, kind: str) -> str:
    """The element's name. Raises SpecError where it has none."""
    name = element.get("name", "").strip()
    if not name or not name.isprintable():
        raise SpecError(f"a {kind} has no name; give it one")
    return name
