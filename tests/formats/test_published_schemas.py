"""The published schemas are a contract: they stay as they are kept beside this file.

A change is a new version of a schema, or an addition that files of before still meet; it is kept anew by writing
`schema_text(name)` there.
"""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from posekit.formats.own import SCHEMA_NAMES, schema, schema_text

KEPT_SCHEMAS = Path(__file__).parent / "schemas"


@pytest.mark.parametrize("name", SCHEMA_NAMES)
def test_a_schema_stays(name: str) -> None:
    assert schema_text(name) == (KEPT_SCHEMAS / f"{name.replace('/', '.')}.json").read_text(encoding="utf-8")


def test_no_other_schemas_are_kept() -> None:
    assert {path.stem for path in KEPT_SCHEMAS.iterdir()} == {name.replace("/", ".") for name in SCHEMA_NAMES}


def test_texts_are_readable_json_of_the_same() -> None:
    for name in SCHEMA_NAMES:
        text = schema_text(name)
        assert json.loads(text) == schema(name)
        assert not re.search(r"\\u[0-9a-f]{4}", text)
        assert text.endswith("}\n")


def references(document: Any) -> list[str]:
    if isinstance(document, dict):
        own = [document["$ref"]] if isinstance(document.get("$ref"), str) else []
        return own + [each for value in document.values() for each in references(value)]
    if isinstance(document, list):
        return [each for value in document for each in references(value)]
    return []


@pytest.mark.parametrize("name", SCHEMA_NAMES)
def test_every_reference_leads_somewhere(name: str) -> None:
    document = schema(name)
    for reference in references(document):
        assert reference.removeprefix("#/$defs/") in document["$defs"]
