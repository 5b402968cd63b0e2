"""The page on how the code is laid out is true: its rooms, its picture, and the files and functions that it names."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/reference/layout.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def layers():
    """Return the module that draws the picture."""
    spec = importlib.util.spec_from_file_location("make_layers", ROOT / "docs/make_layers.py")
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def rooms_of_the_table() -> list[str]:
    """Name the rooms in the order of the table."""
    return re.findall(r"`(\w+)`", PAGE.partition("From the bottom up:")[2].partition("Beside them")[0])


def test_every_room_is_in_the_table():
    rooms = rooms_of_the_table()
    folders = {path.parent.name for path in (ROOT / "posekit").glob("*/__init__.py")}
    modules = {path.stem for path in (ROOT / "posekit").glob("*.py")} - {"__init__"}
    assert sorted(rooms) == sorted(folders | modules)


def test_the_table_is_in_the_order_of_the_layers(layers):
    rooms = rooms_of_the_table()
    height = {room: -row for row, named in enumerate(layers.layers()) for room in named}
    heights = [height[room] for room in rooms if room != "urdf"]
    assert heights == sorted(heights)


def test_the_picture_is_the_contracts(layers):
    drawn = layers.PICTURE.read_text(encoding="utf-8")
    assert drawn == layers.svg(), "run: python docs/make_layers.py"


def test_the_files_that_it_names_are_there():
    named = set(re.findall(r"`([\w/.-]+/[\w.-]*)`", re.sub(r"\{doc\}`[^`]*`", "", PAGE))) - {"docs/formats/"}
    assert len(named) > 30
    missing = [
        name for name in named if not any((ROOT / place / name).exists() for place in (".", "posekit"))
    ]
    assert missing == []


def test_the_functions_of_the_way_of_a_view_are_in_its_files():
    way = PAGE.partition("## The way of a view")[2].partition("From `posekit recover`")[0]
    rows = [line.strip("|").split("|") for line in way.splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 8
    for _, functions, files in rows:
        text = "".join(
            file.read_text(encoding="utf-8")
            for name in re.findall(r"`([\w/.]+)`", files)
            for file in (
                [ROOT / "posekit" / name] if name.endswith(".py") else (ROOT / "posekit" / name).rglob("*.py")
            )
        )
        for function in re.findall(r"`([\w.]+)`", functions):
            name = function.rpartition(".")[2]
            assert re.search(rf"\b(?:def|class) {name}\b", text), function
