"""COLLADA: no entities, counts that are those of the content, every number finite."""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree

from posekit.errors import InputError
from posekit.safe_io.mesh_numbers import MAX_POLYGON, finite_numbers, whole_numbers
from posekit.safe_io.refusal import cut, refusal
from posekit.safe_io.text_file import decode
from posekit.safe_io.xml_file import parse_xml

_MAX_COUNT: Final = 10_000_000
_MAX_ELEMENTS: Final = 1_000_000
"""A polygon may be an element of its own."""
_MAX_NESTED: Final = 32
"""Nodes of the library that place other nodes: with so few, at most 3**(32/3) copies can come of them."""
_COUNTS: Final = ("count", "stride", "offset")
_NUMBERS: Final = frozenset(("float_array", "matrix", "translate", "rotate", "scale"))
_INDICES: Final = frozenset(("p", "vcount", "v", "h"))
_FACES: Final = frozenset(("triangles", "polylist", "polygons", "trifans", "tristrips"))


def count_dae(path: Path, data: bytes) -> int:
    """Look through a COLLADA file and count its faces."""
    root = parse_xml(decode(path, data), path, max_elements=_MAX_ELEMENTS)
    if _name(root) != "COLLADA":
        raise refusal(path, "", f"the root element <{cut(_name(root))}>", "<COLLADA>", "export it again")
    faces = 0
    for element in root.iter():
        name = _name(element)
        for attribute in _COUNTS:
            if attribute in element.attrib:
                _count(path, element, attribute)
        words = (element.text or "").split()
        if name in _NUMBERS:
            finite_numbers(path, f"<{name}>", words)
            if name == "float_array" and _count(path, element, "count") != len(words):
                got, expected = f"count={element.get('count')}", f"{len(words):,}, the numbers in it"
                raise refusal(path, f"<{name}>", got, expected, "export the mesh again")
        elif name in _INDICES:
            indices = whole_numbers(path, f"<{name}>", words)
            if name == "vcount" and indices.max(initial=0) > MAX_POLYGON:
                got, expected = f"a face of {indices.max():,} corners", f"at most {MAX_POLYGON}"
                raise refusal(path, "<vcount>", got, expected, "triangulate it")
        elif name in _FACES:
            faces += _faces(path, element)
    nested = [
        inner
        for library in root.iter()
        if _name(library) == "library_nodes"
        for inner in library.iter()
        if _name(inner) == "instance_node"
    ]
    if len(nested) > _MAX_NESTED:
        got = f"{len(nested)} library nodes that place nodes"
        raise refusal(path, "", got, f"at most {_MAX_NESTED}", "export it with its nodes resolved")
    return faces


def _faces(path: Path, element: ElementTree.Element) -> int:
    """Return the declared faces of a primitive, which must fit into the indices that it holds."""
    declared = _count(path, element, "count")
    held = sum(len((inner.text or "").split()) for inner in element if _name(inner) == "p")
    if declared > held:
        got, expected = f"count={declared:,}", f"at most {held:,}, the indices in it"
        raise refusal(path, f"<{_name(element)}>", got, expected, "export the mesh again")
    return declared


def _count(path: Path, element: ElementTree.Element, attribute: str) -> int:
    text = element.get(attribute, "0")
    if not (text.isascii() and text.isdigit() and len(text) < 9 and int(text) <= _MAX_COUNT):
        raise _wrong_count(path, element, attribute, text)
    return int(text)


def _wrong_count(path: Path, element: ElementTree.Element, attribute: str, text: str) -> InputError:
    place = f"<{cut(_name(element))} {attribute}=…>"
    return refusal(path, place, cut(repr(text)), f"a whole number up to {_MAX_COUNT:,}", "export it again")


def _name(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2]
