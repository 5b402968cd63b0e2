"""The runner of faults: faults are faults, draws are even, and a fault is found by a test that runs it."""

import ast
import json
import subprocess
import sys

import pytest

from benchmarks.mutants import __main__ as command_line
from benchmarks.mutants.files import ROOT, files_of_rooms
from benchmarks.mutants.mutations import Mutant, mutants
from benchmarks.mutants.runner import chosen_tests

FILES = [file for found in files_of_rooms().values() for file in found]
BITS = "posekit/tree/bits.py"
BITS_TEST = "tests/tree/test_tree.py::test_the_whole_body_has_8192_leaves"


@pytest.mark.parametrize("file", FILES[:: len(FILES) // 12])
def test_every_fault_is_another_program(file: str) -> None:
    source = (ROOT / file).read_text(encoding="utf-8")
    found = list(mutants(file, source))
    assert len({each.name for each in found}) == len(found)
    tree = ast.dump(ast.parse(source))
    for each in found:
        assert ast.dump(ast.parse(each.planted(source))) != tree, each
    assert not any(each.before.startswith('"""') for each in found)


def test_every_beginning_of_a_draw_is_even_over_the_files() -> None:
    names = [each.name for each in command_line.drawn(FILES, 7)]
    first = [each.file for each in command_line.drawn(FILES, 7)][: 2 * len(FILES)]
    full = {file for file in FILES if any(mutants(file, (ROOT / file).read_text(encoding="utf-8")))}
    assert len(full) > 0.98 * len(FILES)
    assert set(first[: len(full)]) == full
    assert max(first.count(file) for file in FILES) <= 3
    assert names == [each.name for each in command_line.drawn(FILES, 7)]
    assert names != [each.name for each in command_line.drawn(FILES, 8)]


def test_what_is_explained_is_a_fault() -> None:
    explained = json.loads((ROOT / "benchmarks/mutants/explained.json").read_text(encoding="utf-8"))
    of_files = {name.split(": ")[0] for name in explained}
    faults = [
        each._asdict()
        for file in of_files
        for each in mutants(file, (ROOT / file).read_text(encoding="utf-8"))
    ]
    assert set(explained) <= {command_line.name_of(each) for each in faults}


def test_tests_of_the_line_come_first_and_the_nearest_of_them() -> None:
    seconds = {
        "tests/tree/test_a.py::slow": 9.0,
        "tests/cli/test_b.py::fast": 0.1,
        "tests/tree/test_a.py::other": 1.0,
    }
    lines = {0: set(seconds), 3: {"tests/tree/test_a.py::slow", "tests/cli/test_b.py::fast"}}
    fault = Mutant(BITS, 3, 0, 1, "a", "b", on_loading=False)
    assert chosen_tests(fault, lines, seconds) == [
        "tests/tree/test_a.py::slow",
        "tests/cli/test_b.py::fast",
        "tests/tree/test_a.py::other",
    ]


def test_a_fault_is_found_by_a_test_and_one_that_changes_nothing_is_not() -> None:
    """In a process of its own, as it forks."""
    code = f"""
import pytest
from benchmarks.mutants.files import ROOT
from benchmarks.mutants.mutations import Mutant, mutants
from benchmarks.mutants.runner import OPTIONS, Collected

faults = mutants({BITS!r}, (ROOT / {BITS!r}).read_text(encoding="utf-8"))
wrong = next(each for each in faults if each.before == "return path")
endless = wrong._replace(after="while True: pass")
same = Mutant({BITS!r}, 1, 0, 3, chr(34) * 3, chr(34) * 3, on_loading=True)

def work(tests):
    for fault in (None, same, wrong, wrong._replace(on_loading=True), endless):
        print("found", tests.in_fork(fault, [{BITS_TEST!r}], {{{BITS_TEST!r}: 0.0}}, 1.0 if fault is endless else 60.0))

pytest.main([{BITS_TEST!r}, *OPTIONS], plugins=[Collected(work)])
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    found = [line.split(" ", 1)[1] for line in done.stdout.splitlines() if line.startswith("found")]
    assert found == ["", "", BITS_TEST, BITS_TEST, "None"]
