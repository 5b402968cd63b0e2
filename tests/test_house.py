"""Laws of how the code is built: none may be broken more often than it is. A ceiling only ever goes down."""

import importlib
from collections.abc import Collection
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]

MOST_CLASS_NAMES_USED_TWICE = 0
MOST_ONE_WORD_CONSTANTS = (
    12  # each counted in every module that assigns it; single letters are not: those of posekit.skeleton
)
MOST_LONG_SIGNATURES = 0  # more than eight parameters, outside compiled/ and cli/
MOST_UNDESCRIBED_PARAMETERS = 0
MOST_LONG_TEST_FILES = 0


@pytest.fixture(scope="module")
def house():
    """Return the module that counts, which is not installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        return importlib.import_module("benchmarks.house")


@pytest.fixture(scope="module")
def sources(house: ModuleType):
    return house.installed(ROOT)


def hold(count: int, ceiling: int, found: Collection[str]) -> None:
    listed = "\n".join(found)
    assert count <= ceiling, f"{count} found, at most {ceiling} allowed; among these is a new one:\n{listed}"


def test_a_class_name_means_one_thing(house, sources):
    found = house.several(house.class_names(sources))
    hold(len(found), MOST_CLASS_NAMES_USED_TWICE, found)


def test_a_constant_has_more_than_one_word(house, sources):
    found = {name: count for name, count in house.one_word_constants(sources).items() if len(name) > 1}
    hold(sum(found.values()), MOST_ONE_WORD_CONSTANTS, found)


def test_a_function_has_at_most_eight_parameters(house, sources):
    found = house.long_signatures(sources)
    hold(len(found), MOST_LONG_SIGNATURES, found)


def test_a_documented_parameter_is_described(house, sources):
    found = house.undescribed(sources)
    hold(len(found), MOST_UNDESCRIBED_PARAMETERS, found)


def test_a_test_file_has_at_most_600_lines(house):
    found = house.long_tests(ROOT)
    hold(len(found), MOST_LONG_TEST_FILES, found)


def test_installed_files_are_read_once_under_the_name_they_are_imported_by(sources):
    modules = [source.module for source in sources]
    assert len(modules) == len(set(modules))
    assert {"posekit", "posekit.errors", "posekit.validators", "posekit.viewer", "posekit.urdf"} <= set(
        modules
    )


SAMPLE = '''"""A module.

Of two lines.
"""

from os import (
    path,
)

# Why it is five.
LEAST: int = 5  # metres
"""What it is."""
if LEAST:
    R = MOST_TURNS = 1

    class Kind:
        """A kind.

        Parameters
        ----------
        a : int
        b : int
            What b is.
        c, d : int

        Returns
        -------
        float
        """

        HIDDEN = 1

        def long(self, a, b, c, d, /, e, *, f, g, h):
            WITHIN = """text

            that is no docstring"""

        def longer(self, a, b, c, d, /, e, *, f, g, h, i): ...


class Kind: ...
'''


@pytest.fixture
def sample(house: ModuleType):
    def at(place: str):
        return house.Source(place=Path(place), module="posekit.sample", text=SAMPLE)

    return at


def test_lines_and_comments_of_a_sample(house, sample):
    # LEAST, if, R, class, HIDDEN, long, three of text of which the blank one counts, longer, class.
    assert house.lines_and_comments(sample("posekit/sample.py")) == (11, 2)


def test_laws_count_what_breaks_them(house, sample):
    one = [sample("posekit/sample.py")]
    assert house.several(house.class_names(one)) == {"Kind": 2}
    assert house.one_word_constants(one) == {"LEAST": 1, "R": 1}
    assert [line.split(" ", 1)[1] for line in house.long_signatures(one)] == ["longer (9)"]
    assert house.long_signatures([sample("posekit/compiled/sample.py")]) == []
    assert [line.rpartition(": ")[0].partition("Kind: ")[2] for line in house.undescribed(one)] == [
        "a ",
        "c, d ",
    ]
