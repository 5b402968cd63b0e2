"""XML: no DOCTYPE, no entities, bounded depth and number of elements.

Parsers differ on entities: one expands them, another leaves them as they are, a third returns half of the
document. A text without them means the same to all.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import defusedxml
from defusedxml.ElementTree import DefusedXMLParser

from posekit.safe_io.refusal import cut, one_line, refusal
from posekit.safe_io.text_file import read_text

MAX_BYTES: Final = 10_000_000
"""The largest robot description; those that are published stay below 0.3 MB."""
MAX_DEPTH: Final = 64
MAX_ELEMENTS: Final = 100_000


def read_xml(path: str | Path, *, limit: int = MAX_BYTES) -> ElementTree.Element:
    """Read an XML file of at most `limit` bytes: `read_text`, then `parse_xml`."""
    return parse_xml(read_text(path, limit=limit, too_large="name a smaller file"), path)


def parse_xml(
    text: str, source: str | Path, *, max_depth: int = MAX_DEPTH, max_elements: int = MAX_ELEMENTS
) -> ElementTree.Element:
    """Parse XML that came from `source`.

    Parameters
    ----------
    text : str
        The document.
    source : str or path
        What to call it in errors.
    max_depth, max_elements : int
        How deep elements may nest, and how many there may be.

    Returns
    -------
    Element
        The root; comments and processing instructions are left out.

    Raises
    ------
    InputError
        Where the text is malformed (with line and column), has a DOCTYPE or an entity, or is beyond a bound.
    """
    target = _BoundedBuilder(source, max_depth, max_elements)
    parser = DefusedXMLParser(target=target, forbid_dtd=True)
    try:
        parser.feed(text)
        root: ElementTree.Element = parser.close()
    except ElementTree.ParseError as error:
        remedy = "correct the file there"
        raise refusal(
            source, "", f"not well-formed XML: {cut(one_line(str(error)))}", "XML", remedy
        ) from None
    except defusedxml.DefusedXmlException:
        got = "DOCTYPE and entities are refused"
        raise refusal(source, "", f"a DOCTYPE; {got}", "XML without them", "remove them") from None
    except UnicodeEncodeError as error:
        remedy = "save it as UTF-8"
        raise refusal(source, f"character {error.start}", "half a character", "text", remedy) from None
    return root


class _BoundedBuilder(ElementTree.TreeBuilder):
    """Builds the tree, and stops where it grows too deep or too large."""

    def __init__(self, source: str | Path, max_depth: int, max_elements: int) -> None:
        super().__init__()
        self._source = source
        self._depth = self._elements = 0
        self._max_depth, self._max_elements = max_depth, max_elements

    def start(self, tag: str, attrs: Mapping[Any, Any]) -> ElementTree.Element:
        self._depth += 1
        self._elements += 1
        if self._depth > self._max_depth:
            got, expected = f"{self._depth} nested elements", f"at most {self._max_depth} levels"
            raise refusal(self._source, "", got, expected, "flatten it")
        if self._elements > self._max_elements:
            got, expected = f"more than {self._max_elements:,} elements", f"at most {self._max_elements:,}"
            raise refusal(self._source, "", got, expected, "name a smaller file")
        return super().start(tag, dict(attrs))

    def end(self, tag: str) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)
