"""Parsers of YAML and XML files of OpenCV's FileStorage and ROS; they return maps, lists, numbers and words."""

from __future__ import annotations

import re
from typing import Any, Final
from xml.etree import ElementTree

import yaml

from posekit.errors import cut, one_line, refusal, shown
from posekit.files import text

#: Values of the words that are not read as text.
WORDS: Final[dict[str, Any]] = {
    **{"true": True, "false": False, "null": None, "~": None, "": None},
    **{".nan": float("nan"), ".inf": float("inf"), "-.inf": float("-inf")},
}


class _Loader(yaml.BaseLoader):  # type: ignore[misc]
    """YAML loader that refuses aliases and repeated keys, and knows no tags except OpenCV's."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.MarkedYAMLError(problem="an alias", problem_mark=self.peek_event().start_mark)
        return super().compose_node(parent, index)

    def construct_scalar(self, node: yaml.ScalarNode) -> Any:
        return node.value if node.style else scalar(node.value)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in node.value:
            if (name := str(key.value)) in found:
                raise yaml.MarkedYAMLError(problem="the same key twice", problem_mark=key.start_mark)
            found[name] = self.construct_object(value, deep)
        return found


def parse_yaml(data: bytes, source: str) -> Any:
    """Parse YAML.

    Raises
    ------
    InputError
        If the text is not YAML, or has aliases, several documents or a repeated key.
    """
    # OpenCV writes "%YAML:1.0", which is not YAML's own directive.
    content = re.sub(r"^%.*$", "", text(data, source), flags=re.MULTILINE)
    expected = "maps, lists, numbers and words"
    try:
        found = yaml.load(content, _Loader)
    except yaml.MarkedYAMLError as error:
        line = (error.context_mark or error.problem_mark).line
        got = shown("".join(content.splitlines()[line : line + 1]))
        raise refusal(source, f"line {line + 1}", got, f"{expected} ({error.problem})") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise refusal(source, "", cut(one_line(str(error))), expected) from None
    if found is None:
        raise refusal(source, "", "nothing but comments", "YAML", "check how it was written")
    return found


def parse_xml(data: bytes, source: str) -> dict[str, Any]:
    """Parse XML; entities and document types are refused."""
    import defusedxml.ElementTree as safe

    try:
        root = safe.fromstring(text(data, source), forbid_dtd=True)
    except (ElementTree.ParseError, ValueError) as error:  # refused entities are a ValueError
        reason = cut(one_line(str(error)))
        raise refusal(source, "", f"no plain XML: {reason}", "XML without a document type") from None
    if root.tag != "opencv_storage":
        raise refusal(
            source, "", f"<{cut(root.tag)}>", "cameras in <opencv_storage>", "give a robot with --urdf"
        )
    return {element.tag: _xml_value(element) for element in root}


def _xml_value(element: ElementTree.Element) -> Any:
    """Convert an element to an object, a list, numbers or a text."""
    if len(element):
        inner = {child.tag: _xml_value(child) for child in element}
        return [_xml_value(child) for child in element] if set(inner) == {"_"} else inner
    words = (element.text or "").split()
    values = [scalar(word) for word in words]
    if not all(type(value) in (int, float) for value in values):
        return (element.text or "").strip().strip('"')
    return values[0] if len(values) == 1 and element.tag != "data" else values


def scalar(word: str) -> Any:
    """Convert an unquoted word to a number, a truth value, None, or a text."""
    word = word.strip()
    if word.casefold() in WORDS:
        return WORDS[word.casefold()]
    if re.fullmatch(r"[+-]?\d{1,18}", word):
        return int(word)
    return float(word) if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?", word) else word
