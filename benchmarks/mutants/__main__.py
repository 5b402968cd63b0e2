"""Draw faults evenly over the files, try each, and print how many the tests found in each room."""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain, islice, zip_longest
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutants.files import ROOT, files_of_rooms, folders_of_tests
from benchmarks.mutants.line_map import map_lines, read_maps
from benchmarks.mutants.mutations import Mutant, mutants
from benchmarks.mutants.runner import OPTIONS, TESTED_SECONDS, Collected, as_line, chosen_tests


def drawn(files: list[str], seed: int) -> Iterator[Mutant]:
    """Yield all faults, in turn one of each file, so that every beginning is even over the files."""
    rng = random.Random(seed)
    piles = []
    for file in files:
        pile = list(mutants(file, (ROOT / file).read_text(encoding="utf-8")))
        rng.shuffle(pile)
        piles.append(pile)
    rng.shuffle(piles)
    return (one for one in chain.from_iterable(zip_longest(*piles)) if one is not None)


def table(outcomes: list[dict[str, Any]], explained: dict[str, str]) -> Iterator[str]:
    """Yield the table of rooms: drawn, found, left, and of these which change nothing that can be seen."""
    yield "| room | files | faults | found | share | explained |"
    yield "|---|---|---|---|---|---|"
    rows = [(room, set(files)) for room, files in files_of_rooms().items()]
    for room, files in [*rows, ("all", set().union(*(files for _, files in rows)))]:
        own = [each for each in outcomes if each["file"] in files]
        left = [each for each in own if each["outcome"] == "survived"]
        found = len(own) - len(left)
        known = sum(name_of(each) in explained for each in left)
        yield f"| {room} | {len(files)} | {len(own)} | {found} | {found / max(len(own), 1):.1%} | {known} |"


def name_of(outcome: Mapping[str, Any]) -> str:
    """Return a fault's name as explanations have it: by its text and that of its line, as places move."""
    line = (ROOT / outcome["file"]).read_text(encoding="utf-8").splitlines()[outcome["line"] - 1].strip()
    return f"{outcome['file']}: {line}: {outcome['before']} -> {outcome['after']}"


def main() -> None:
    """Run the mutants that are asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "mutants-results", help="a folder")
    parser.add_argument("--count", type=int, default=1000, help="how many faults")
    parser.add_argument("--seed", type=int, default=1985)
    parser.add_argument(
        "--seconds", type=float, default=TESTED_SECONDS, help="of tests that a fault is given"
    )
    parser.add_argument(
        "--again", action="store_true", help="try those that survived and are not explained once more"
    )
    parser.add_argument("--map", nargs="+", metavar="TESTS", help="read which lines new tests run, and end")
    given = parser.parse_args()
    maps, results = given.output / "maps", given.output / "outcomes.jsonl"
    files = [file for found in files_of_rooms().values() for file in found]
    if not maps.is_dir():
        map_lines(maps / "all.json", files, folders_of_tests())
    if given.map:
        map_lines(maps / f"more_{len(list(maps.iterdir()))}.json", files, given.map)
        return
    explained = json.loads((Path(__file__).parent / "explained.json").read_text(encoding="utf-8"))
    before: list[dict[str, Any]] = []
    if results.exists():
        before = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]
    last = {each["name"]: "explained" if name_of(each) in explained else each["outcome"] for each in before}

    def work(tests: Collected) -> None:
        seconds, lines = read_maps(maps, tests.items)

        @cache
        def fails(name: str) -> bool:
            return tests.in_fork(None, [name], seconds) != ""

        for one in islice(drawn(files, given.seed), given.count):
            known = last.get(one.name)
            if known and not (given.again and known == "survived"):
                continue
            own = lines.get(one.file, {})
            # A line that no test runs is run while something is imported.
            mutant = one._replace(on_loading=one.on_loading or not own.get(one.line))
            chosen = chosen_tests(mutant, own, seconds, given.seconds)
            trial = tests.tried(mutant, chosen, seconds, fails)
            with results.open("a", encoding="utf-8") as out:
                print(as_line(mutant, trial), file=out, flush=True)

    pytest.main([*folders_of_tests(), *OPTIONS], plugins=[Collected(work)])
    outcomes = {
        each["name"]: each for each in map(json.loads, results.read_text(encoding="utf-8").splitlines())
    }
    print(*table(list(outcomes.values()), explained), sep="\n")


if __name__ == "__main__":
    main()
