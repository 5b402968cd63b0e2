"""The attack: damage is the same for a seed, and what is not clean is told from what is."""

import io
import json
import random
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from xml.etree import ElementTree

import pyarrow as arrow
import pytest
from pyarrow import parquet

from benchmarks.fuzz.cases import Case, option_case
from benchmarks.fuzz.damage import damaged
from benchmarks.fuzz.structure import rearranged
from benchmarks.fuzz.trial import Outcome, tried
from posekit.robots.find import find
from posekit.samples import write_samples

FINDS = Path(__file__).parent / "finds"
VALIDATE = ["validate", "SEEDS/walk.npz", "-o", "OUT.json"]


@pytest.mark.parametrize("data", [b"", b"1", b"a = [1, 2.5e3]\n" * 50, bytes(range(256)) * 9])
def test_damage_is_the_same_for_a_seed(data: bytes) -> None:
    found = [damaged(data, random.Random(seed)) for seed in range(200)]
    assert found == [damaged(data, random.Random(seed)) for seed in range(200)]
    assert len(set(found)) > (5 if len(data) < 2 else 100)


@pytest.mark.parametrize("name", ["walk.json", "stick_figure.urdf", "motion.parquet"])
def test_what_a_file_says_is_changed_and_its_grammar_stays(seeds: Path, name: str) -> None:
    data = whole(seeds, name)
    readers: dict[str, Callable[[bytes], object]] = {
        "walk.json": json.loads,
        "stick_figure.urdf": ElementTree.fromstring,
        "motion.parquet": table_of,
    }
    found = [rearranged(data, random.Random(seed)) for seed in range(60)]
    assert found == [rearranged(data, random.Random(seed)) for seed in range(60)]
    changed = [one for one in found if one is not None and one != data]
    assert len(set(changed)) > 30
    for one in changed:
        readers[name](one)


@pytest.mark.parametrize("kept", sorted(FINDS.glob("*.case.json")), ids=lambda path: path.name)
def test_a_find_of_before_is_clean(seeds: Path, tmp_path: Path, kept: Path) -> None:
    held = json.loads(kept.read_text(encoding="utf-8"))
    data = (
        kept.with_name(kept.name.replace("case.json", Path(held["name"]).name)).read_bytes()
        if held["name"]
        else b""
    )
    found = tried(Case(held["kind"], held["arguments"], held["name"], data), seeds, tmp_path / "case")
    assert found.clean, found


def test_whole_files_stay_whole_where_an_option_names_one_to_be_written(seeds: Path, tmp_path: Path) -> None:
    before = whole(seeds, "photo.json")
    found = tried(
        Case("options", ["synth", "walker", "-o", "SEEDS/photo.json", "--frames", "1"]),
        seeds,
        tmp_path / "case",
    )
    assert found.what == "accepted", found
    assert whole(seeds, "photo.json") == before


def test_options_are_those_of_the_command() -> None:
    cases = [option_case(random.Random(seed)) for seed in range(300)]
    given = {word for case in cases for word in case.arguments if word.startswith("--") and len(word) > 2}
    assert given >= {"--rigid-tolerance", "--urdf", "--frames", "--posture", "--camera"}
    assert "--help" not in given


@pytest.fixture(scope="module")
def seeds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("seeds")
    write_samples(folder)
    return folder


def whole(seeds: Path, name: str) -> bytes:
    """Return a whole file."""
    if name.endswith(".urdf"):
        return Path(find("stick_figure").urdf).read_bytes()
    if name.endswith(".parquet"):
        out = io.BytesIO()
        parquet.write_table(arrow.table({"a": [1.0, 2.0, 3.0], "b": [1, 2, 3], "c": ["x", "y", "z"]}), out)
        return out.getvalue()
    return (seeds / name).read_bytes()


def table_of(data: bytes) -> object:
    """Read a table."""
    return parquet.ParquetFile(io.BytesIO(data)).metadata


def outcome(seeds: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> Outcome:
    """Try `validate`, which does what is said instead."""

    def main() -> None:
        exec(command, {"folder": Path.cwd()})

    if command:
        monkeypatch.setattr(import_module("posekit.__main__"), "main", main)
    return tried(Case("options", VALIDATE), seeds, tmp_path / "case")


@pytest.mark.parametrize(
    ("command", "what"),
    [
        ("", "accepted"),
        ("raise SystemExit(2)", "not one line"),
        ("print('posekit: error: a'); raise SystemExit(2)", "refused"),
        ("print('posekit: error: a\\x07'); raise SystemExit(2)", "not printable"),
        ("(folder / 'x').touch(); print('posekit: error: a'); raise SystemExit(2)", "half-written"),
        ("raise KeyError(1)", "traceback"),
        ("raise SystemExit(3)", "exit 3"),
        ("import os; os.abort()", "signal 6"),
        ("(folder / 'x.json').write_text('[NaN]')", "not finite"),
        ("(folder / 'x.csv').write_text('a,-inf')", "not finite"),
        ("(folder / 'x.json').write_text('{\"schema\": \"posekit.view/1\"}')", "not of its schema"),
        ("(folder / 'x.part').touch()", "left over"),
        ("import time; time.sleep(9)", "hang"),
    ],
)
def test_what_is_not_clean_is_told(
    seeds: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, what: str
) -> None:
    if what == "hang":
        monkeypatch.setattr("benchmarks.fuzz.trial.in_fork", lambda *given, **named: None)
    found = outcome(seeds, tmp_path, monkeypatch, command)
    assert found.what == what, found
    assert found.clean == (what in ("accepted", "refused"))
