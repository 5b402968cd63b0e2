"""Lengths that miss closing are laid onto the nearest body; those that close stay as they are, to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.body import LengthUncertainty, load_figure
from posekit.body.closing import HIPS_LENGTHS, MAX_MOVED, TORSO_LENGTHS, closed_lengths, closing_line
from posekit.body.lengths import hips_points, torso_points
from posekit.body.uncertainty import MEASURED_LENGTHS
from posekit.body.urdf import rewrite
from posekit.errors import FigureError
from posekit.skeleton import SEGMENT_NAMES, other_side

FIGURE = load_figure()
OWN = dict(FIGURE.lengths)
WIDEST = 2 * np.sqrt(0.205**2 - 0.004740820734341**2)
"""Metres between the built-in figure's shoulders where they are beside its spine: with more it does not close."""

factors = st.lists(st.floats(-0.08, 0.08), min_size=17, max_size=17)


def made(logarithms: list[float]) -> dict[str, float]:
    return {name: OWN[name] * float(np.exp(x)) for name, x in zip(SEGMENT_NAMES, logarithms, strict=True)}


def cost(lengths: dict[str, float], wanted: dict[str, float], names: tuple[str, ...]) -> float:
    own = MEASURED_LENGTHS.own
    return sum(float(np.log(lengths[name] / wanted[name]) / own[name]) ** 2 for name in names)


def closes(lengths: dict[str, float]) -> bool:
    try:
        torso_points(lengths)
        hips_points(lengths)
    except FigureError:
        return False
    return True


@given(factors)
def test_lengths_that_close_give_the_same_figure_to_the_last_bit(logarithms: list[float]) -> None:
    lengths = made(logarithms)
    if not closes(lengths):
        return
    figure = FIGURE.scaled(lengths)
    head = FIGURE.neutral_points[14:] - FIGURE.neutral_points[0]
    assert figure.urdf == rewrite(FIGURE.urdf, FIGURE.capsules, FIGURE.neutral_points, lengths, head)
    assert not figure.moved_lengths
    assert closing_line(figure.moved_lengths) == ""


@given(factors)
def test_what_is_closed_closes_and_is_closed_once(logarithms: list[float]) -> None:
    found = closed_lengths(made(logarithms))
    assert closes(dict(found.lengths))
    assert not closed_lengths(found.lengths).moved


@given(factors, st.floats(0.2, 3.0))
def test_closing_knows_no_size(logarithms: list[float], size: float) -> None:
    lengths = made(logarithms)
    one = closed_lengths(lengths).lengths
    other = closed_lengths({name: size * length for name, length in lengths.items()}).lengths
    for name in SEGMENT_NAMES:
        assert other[name] == pytest.approx(size * one[name], rel=1e-6)


@given(factors)
def test_closing_knows_no_side(logarithms: list[float]) -> None:
    def mirrored(lengths: dict[str, float]) -> dict[str, float]:
        swapped = {}
        for name, length in lengths.items():
            ends = "-".join(map(other_side, name.split("-")))
            swapped[ends if ends in OWN else "-".join(reversed(ends.split("-")))] = length
        return swapped

    lengths = made(logarithms)
    one = mirrored(dict(closed_lengths(lengths).lengths))
    for name, length in closed_lengths(mirrored(lengths)).lengths.items():
        assert length == pytest.approx(one[name], rel=1e-6)


@pytest.mark.parametrize("width", [WIDEST + 1e-5, WIDEST + 1e-3, 0.45])
def test_no_other_flat_torso_is_nearer(width: float, rng: np.random.Generator) -> None:
    wanted = OWN | {"right_shoulder-left_shoulder": width}
    found = dict(closed_lengths(wanted).lengths)
    least = cost(found, wanted, TORSO_LENGTHS)
    points = torso_points(found)[:, 1:]
    assert least > 0
    for size in (1e-5, 1e-4, 1e-3, 1e-2):
        for _ in range(50):
            neck, right, left, pelvis = points + size * rng.normal(size=points.shape)
            other = {
                name: float(np.linalg.norm(a - b))
                for name, a, b in (
                    ("neck-right_shoulder", neck, right),
                    ("neck-left_shoulder", neck, left),
                    ("neck-pelvis", neck, pelvis),
                    ("right_shoulder-left_shoulder", right, left),
                    ("right_shoulder-pelvis", right, pelvis),
                    ("left_shoulder-pelvis", left, pelvis),
                )
            }
            assert cost(other, wanted, TORSO_LENGTHS) >= least * (1 - 1e-9)


def test_hips_that_do_not_close_share_what_is_missing() -> None:
    # On a line the near hip, the far hip and their distance: the nearest lengths share the miss by squares of lengths.
    found = closed_lengths(OWN | {"right_hip-left_hip": 0.40})
    right, left, width = (found.lengths[name] for name in HIPS_LENGTHS)
    assert right + left == pytest.approx(width, abs=1e-12)
    assert right == pytest.approx(left)
    # d/dx of 2 log^2(x / 0.19) + log^2(2 x / 0.4), zero at the nearest.
    assert 2 * np.log(right / 0.19) + np.log(2 * right / 0.4) == pytest.approx(0, abs=1e-9)
    assert set(found.moved) == set(HIPS_LENGTHS)


@pytest.mark.parametrize("missing", [3e-6, 1e-4, 5e-4, 5e-3])
def test_a_small_miss_is_a_small_change_and_said(missing: float) -> None:
    figure = FIGURE.scaled({"right_shoulder-left_shoulder": WIDEST + missing})
    most = max(map(abs, figure.moved_lengths.values()))
    assert 0 < most <= missing
    assert abs(figure.shoulder_offset) < 1e-6
    line = closing_line(figure.moved_lengths)
    assert "right_shoulder-left_shoulder most, by -" in line
    assert "\n" not in line


def test_what_is_known_worse_is_changed_more() -> None:
    wanted = OWN | {"right_shoulder-left_shoulder": 0.43}
    doubtful = LengthUncertainty(
        own={name: 0.1 if name == "right_shoulder-left_shoulder" else 0.01 for name in SEGMENT_NAMES}
    )
    alike = closed_lengths(wanted, LengthUncertainty.uniform(0.02))
    other = closed_lengths(wanted, doubtful)
    assert other.lengths["right_shoulder-left_shoulder"] < alike.lengths["right_shoulder-left_shoulder"]
    assert other.lengths["neck-right_shoulder"] == pytest.approx(0.205, rel=0.01)
    # The size that all lengths share says nothing of their shape.
    for size in (0.0, 0.3):
        again = closed_lengths(wanted, LengthUncertainty(common=size, own=doubtful.own))
        assert again.lengths == other.lengths


@pytest.mark.parametrize("factor", [0.25, 2.0, 10.0])
@pytest.mark.parametrize("name", ["neck-pelvis", "right_shoulder-pelvis", "left_shoulder-pelvis"])
def test_lengths_that_no_body_comes_near_are_refused(name: str, factor: float) -> None:
    with pytest.raises(FigureError, match=r"the nearest body has a length that is \d+% other") as error:
        FIGURE.scaled({name: factor * OWN[name]})
    assert "\n" not in str(error.value)


def test_no_length_is_changed_by_more_than_is_allowed(rng: np.random.Generator) -> None:
    refused = 0
    for _ in range(300):
        lengths = made(list(0.15 * rng.normal(size=17)))
        try:
            found = closed_lengths(lengths)
        except FigureError:
            refused += 1
            continue
        for name, metres in found.moved.items():
            assert abs(metres) <= MAX_MOVED * lengths[name]
    assert 0 < refused < 150


def test_what_was_changed_goes_with_the_figure_until_it_is_said_anew() -> None:
    figure = FIGURE.scaled({"right_shoulder-left_shoulder": WIDEST + 1e-3})
    taller = figure.scaled({"right_hip-right_knee": 0.4})
    assert taller.moved_lengths == figure.moved_lengths
    assert not figure.scaled({name: OWN[name] for name in TORSO_LENGTHS}).moved_lengths
