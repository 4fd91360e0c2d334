"""XML of robot descriptions, parsed without entities, with checks of its numbers.

Python's own parser is used. XML from strangers is dangerous by entities that grow or name other files. These
are declared in a document type declaration, which neither format has, so a file with one is refused.
Libraries for URDF and SDF depend on meshes, lxml or a simulator, and only a few elements are needed here.
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
MAX_ELEMENTS = 1000  # the poses in a chain of so many take two seconds
REFUSED = {  # texts that no plain description has, and the remedy
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
    for sign, what in REFUSED.items():
        if sign in text:
            raise SpecError(f"this is {what}")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise SpecError(f"this is not valid XML: {error}") from None


def numbers(text: str | None, count: int, what: str) -> Array:
    """Return numbers separated by spaces, (count,), zeros for no text. Raises SpecError, naming `what`."""
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
    """Return the unit vector (3,) along three numbers, None for no text. Raises SpecError, naming `what`."""
    if not (text or "").split():
        return None
    vector = numbers(text, 3, what)
    if not vector.any():
        raise SpecError(f"{what} must have a direction, got {' '.join((text or '').split())[:60]!r}")
    scaled = vector / np.abs(vector).max()
    return np.asarray(scaled / np.linalg.norm(scaled))


def child_number(element: Element, tag: str, what: str) -> float:
    """Return the number in a child element, 0 where there is no such element."""
    return float(numbers(element.findtext(tag), 1, f"{what}: {tag}")[0])


def collision_radius(link: Element, name: str, text_of: Callable[[Element, str], str | None]) -> float | None:
    """Return the radius [m] of the collision cylinder, or half the longer side of the box; None without both.

    Args:
        link: The element of the link.
        name: The name of the link.
        text_of: Returns the value of a key of an element: the text of a child in SDF, an attribute in URDF.
    """
    for cylinder in link.iterfind("collision/geometry/cylinder"):
        return float(numbers(text_of(cylinder, "radius"), 1, f"link '{name}': cylinder radius")[0])
    for box in link.iterfind("collision/geometry/box"):
        return float(numbers(text_of(box, "size"), 3, f"link '{name}': box size")[:2].max()) / 2
    return None


def by_name(elements: Iterable[Element]) -> dict[str, Element]:
    """Return elements by their names.

    Raises SpecError for an element without a name, for two with the same name, and for too many elements.
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
    """Return the element's name. Raises SpecError where it has none."""
    name = element.get("name", "").strip()
    if not name or not name.isprintable():
        raise SpecError(f"a {kind} has no name; give it one")
    return name
