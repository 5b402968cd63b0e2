"""COLLADA: nodes that place nodes end, and are not many, before a native library follows them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

from posekit.safe_io.refusal import refusal
from posekit.safe_io.xml_file import parse_xml

DEEPEST_NODE: Final = 64
"""Nodes that hold or place each other, one below another; those of the published robots are two deep."""
MAX_PLACED_NODES: Final = 10_000
"""Each copies its meshes: where 30 nodes each place the next one three times, the last is there 3**30 times."""
NODE_HOLDERS: Final = ("visual_scene", "library_nodes")
"""What holds nodes that no node holds."""


def check_collada(path: Path, data: bytes) -> None:
    """Refuse a COLLADA file whose nodes place themselves, or too many: Assimp follows them to the end of its stack."""
    if b"<COLLADA" not in data or b"<!DOCTYPE" in data:
        got = "DOCTYPE" if b"<!DOCTYPE" in data else "no COLLADA"
        raise refusal(path, "", got, "<COLLADA> without DOCTYPE", "export it again")
    below = _below(parse_xml(data.decode("utf-8", "replace"), path))
    level, placed = Counter(node for node in below if _name(node) in NODE_HOLDERS), 0
    for _ in range(DEEPEST_NODE):
        placed += level.total()
        if placed > MAX_PLACED_NODES:
            got, expected = "many nodes that place nodes", f"at most {MAX_PLACED_NODES:,}"
            raise refusal(path, "", got, expected, "export it with its nodes resolved")
        further: Counter[Element] = Counter()
        for node, times in level.items():
            for child in below[node]:
                further[child] += times
        level = further
    if level:
        got = f"a node that holds itself, or nodes more than {DEEPEST_NODE} deep"
        raise refusal(path, "", got, "nodes that end", "export it with its nodes resolved")


def _below(root: Element) -> dict[Element, list[Element]]:
    """Map each node to those that it holds, and to all of those that Assimp may take for one that it places.

    It seeks a node in the library by its id, and then in the scene, the scene itself among them, by id or name.
    """
    nodes = [element for element in root.iter() if _name(element) in ("node", *NODE_HOLDERS)]
    library: dict[str | None, list[Element]] = {}
    named: dict[str | None, list[Element]] = {}
    for node in nodes:
        for name in {node.get("id"), node.get("name")}:
            named.setdefault(name, []).append(node)
        for child in node if _name(node) == "library_nodes" else ():
            library.setdefault(child.get("id"), []).append(child)
    below: dict[Element, list[Element]] = {node: [] for node in nodes}
    for node in nodes:
        for child in node:
            if child in below:
                below[node].append(child)
            elif _name(child) == "instance_node":
                url = child.get("url", "").removeprefix("#")
                below[node] += library.get(url) or named.get(url, [])
    return below


def _name(element: Element) -> str:
    """Return an element's name without its namespace, for which Assimp does not ask."""
    return element.tag.rpartition("}")[2].rpartition(":")[2]
