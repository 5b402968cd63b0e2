"""Lengths carry their unit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.own import parse_length
from posekit.formats.own.units import UNIT_METRES, UNIT_NAMES, from_metres, to_metres


@given(st.decimals(0, 1000, places=3), st.sampled_from(UNIT_NAMES))
def test_a_decimal_becomes_the_nearest_float(number, unit):
    metres = number.scaleb({"m": 0, "cm": -2, "mm": -3}[unit])
    assert parse_length(f"{number}{unit}") == float(metres)
    assert to_metres(float(number), unit) == pytest.approx(float(metres), rel=3e-16)


@given(st.floats(-1e6, 1e6), st.sampled_from(UNIT_NAMES))
def test_there_and_back(value, unit):
    assert to_metres(from_metres(value, unit), unit) == pytest.approx(value, rel=3e-16, abs=1e-300)
    assert to_metres(value, unit) == pytest.approx(value * UNIT_METRES[unit], rel=3e-16, abs=1e-300)


def test_metres_are_exact(rng):
    values = rng.normal(size=100)
    assert np.array_equal(to_metres(from_metres(values, "m"), "m"), values)


@pytest.mark.parametrize(
    ("text", "metres"),
    [("5cm", 0.05), ("0.05m", 0.05), ("50mm", 0.05), (" 1 m ", 1), (".5m", 0.5), ("5e1mm", 0.05), ("0m", 0)],
)
def test_options_are_read(text, metres):
    assert parse_length(text) == metres


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("5", "add cm, m or mm, as in 5cm"),
        ("1.75", "add cm, m or mm, as in 1.75m"),
        ("0", "add cm"),
        ("5in", "the unit cm, m or mm"),
        ("5CM", "the unit cm, m or mm"),
        ("-5cm", "zero or more"),
        ("", "write it as 5cm"),
        ("cm", "write it as 5cm"),
        ("nanm", "write it as 5cm"),
        ("infm", "write it as 5cm"),
        ("1e999m", "write it as 5cm"),
        ("1,5cm", "write it as 5cm"),
        ("\u0665cm", "write it as 5cm"),
        ("5cm\n5cm", "write it as 5cm"),
        ("9" * 5000 + "cm", "write it as 5cm"),
    ],
)
def test_what_is_no_length_is_refused(text, remedy):
    with pytest.raises(InputError, match=remedy) as caught:
        parse_length(text, name="--group")
    assert str(caught.value).startswith("--group: got ")
    assert str(caught.value).isprintable()
