"""Lengths from stature and from files."""

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.body import load_figure
from posekit.body.anthropometry import (
    SegmentLengths,
    lengths_from_proportions,
    proportion_names,
    read_lengths,
    write_lengths,
)
from posekit.body.anthropometry.body import BODY_DIMENSIONS, TRUNK_LENGTH, dimensions_of, lengths_of
from posekit.body.lengths import hips_points, torso_points
from posekit.body.stature import lengths_from_stature
from posekit.errors import FigureError, InputError
from posekit.skeleton import SEGMENT_NAMES
from posekit.tables.lengths import BOTH_SIDES

FACTORS = st.lists(st.floats(0.7, 1.3), min_size=len(BODY_DIMENSIONS), max_size=len(BODY_DIMENSIONS))


@pytest.mark.parametrize("name", proportion_names())
@given(st.floats(0.5, 2.5))
@settings(deadline=None, max_examples=10)
def test_a_figure_can_be_made_and_grows_with_stature(name: str, stature: float) -> None:
    lengths = lengths_from_proportions(name, stature)
    assert set(lengths.lengths) == set(SEGMENT_NAMES) == set(lengths.deviation)
    assert lengths.stature == stature and lengths.source and not lengths.measured
    torso_points(lengths.lengths)
    hips_points(lengths.lengths)
    twice = lengths_from_proportions(name, stature / 2 if stature > 1 else stature * 2)
    ratio = 0.5 if stature > 1 else 2.0
    for segment, length in lengths.lengths.items():
        assert twice.lengths[segment] == pytest.approx(ratio * length)
        assert 0.03 * length < lengths.deviation[segment] < 0.3 * length


def test_drillis_and_continis_are_those_of_the_figure() -> None:
    expected = lengths_from_stature(1.8, dict(load_figure().lengths))
    for name in ("drillis-contini", "winter"):
        assert lengths_from_proportions(name, 1.8).lengths == pytest.approx(expected, abs=1e-12)


def test_table_a1_is_the_figures_own_shape() -> None:
    figure = load_figure().lengths
    lengths = lengths_from_proportions("table-a1", 1.8).lengths
    ratios = {segment: lengths[segment] / figure[segment] for segment in SEGMENT_NAMES}
    assert max(ratios.values()) == pytest.approx(min(ratios.values()))


def test_de_levas_table() -> None:
    male = lengths_from_proportions("de-leva", 1.741, sex="male").lengths
    female = lengths_from_proportions("de-leva", 1.735, sex="female").lengths
    for segment, man, woman in (
        ("left_shoulder-left_elbow", 0.2817, 0.2751),
        ("right_elbow-right_wrist", 0.2689, 0.2643),
        ("right_hip-right_knee", 0.4222, 0.3685),
        ("left_knee-left_ankle", 0.4403, 0.4386),
    ):
        assert male[segment] == pytest.approx(man) and female[segment] == pytest.approx(woman)
        both = lengths_from_proportions("de-leva", 1.7).lengths[segment] / 1.7
        assert both == pytest.approx((man / 1.741 + woman / 1.735) / 2)
    assert male["right_hip-left_hip"] == pytest.approx(0.19004, rel=0.02)


def test_unknown_sources_and_impossible_statures_are_refused() -> None:
    with pytest.raises(InputError, match="de-leva"):
        lengths_from_proportions("deleva", 1.8)
    with pytest.raises(InputError, match="female or male"):
        lengths_from_proportions("de-leva", 1.8, sex="m")  # type: ignore[arg-type]
    for stature in (180.0, 0.0, -1.8, math.nan, math.inf):
        with pytest.raises(FigureError, match="another unit"):
            lengths_from_proportions("winter", stature)


@settings(deadline=None)
@given(FACTORS)
def test_dimensions_make_a_body_and_come_back(factors: list[float]) -> None:
    reference = dict(load_figure().lengths)
    dimensions = {name: f * v for f, (name, v) in zip(factors, dimensions_of(reference).items(), strict=True)}
    lengths = lengths_of(dimensions, reference)
    back = dimensions_of(lengths)
    assert back == pytest.approx(dimensions, rel=1e-9)
    assert load_figure().scaled(lengths).lengths == pytest.approx(lengths, rel=1e-9)


def test_a_reference_must_be_whole() -> None:
    with pytest.raises(InputError, match="missing"):
        lengths_from_proportions("winter", 1.8, reference={"neck-pelvis": 0.5})


def test_deviations_of_the_torso_follow_from_the_dimensions() -> None:
    whole = lengths_from_proportions("winter", 1.8)
    reference = dict(load_figure().lengths)
    draw = np.random.default_rng(1)
    base = dimensions_of(whole.lengths)
    samples = []
    for _ in range(2000):
        factors = np.exp(draw.normal(size=2) * [0.12, 0.05])
        changed = base | {"right_shoulder-left_shoulder": base["right_shoulder-left_shoulder"] * factors[0]}
        samples.append(
            lengths_of(changed | {TRUNK_LENGTH: base[TRUNK_LENGTH] * factors[1]}, reference)["neck-pelvis"]
        )
    assert whole.deviation["neck-pelvis"] == pytest.approx(np.std(samples), rel=0.1)


# Files


@settings(deadline=None)
@given(
    st.dictionaries(st.sampled_from(SEGMENT_NAMES), st.floats(0.01, 2.5), min_size=1),
    st.sampled_from(["m", "cm", "mm"]),
    st.one_of(st.none(), st.floats(0.5, 2.5)),
    st.text(max_size=20),
)
def test_lengths_round_trip(
    tmp_path_factory: pytest.TempPathFactory,
    lengths: dict[str, float],
    unit: str,
    stature: float | None,
    source: str,
) -> None:
    path = tmp_path_factory.getbasetemp() / "lengths.toml"
    deviation = {name: length / 50 for name, length in list(lengths.items())[::2]}
    given = SegmentLengths(lengths=lengths, deviation=deviation, source=source, stature=stature)
    write_lengths(path, given, unit=unit)
    assert tomllib.loads(path.read_text(encoding="utf-8"))["unit"] == unit
    back = read_lengths(path)
    assert list(back.lengths) == list(lengths)
    assert dict(back.lengths) == pytest.approx(lengths, rel=1e-15)
    assert dict(back.deviation) == pytest.approx(dict(given.deviation), rel=1e-15)
    assert back.stature == (stature if stature is None else pytest.approx(stature, rel=1e-15))
    if unit == "m":
        assert dict(back.lengths) == lengths
    if source.isprintable():
        assert back.source == source


def save(folder: Path, text: str, name: str = "lengths.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


HEAD = 'schema = "posekit.lengths/1"\nunit = "cm"\nsource = "measured with a tape"\n'


def test_a_name_without_a_side_is_both(tmp_path: Path) -> None:
    lengths = read_lengths(
        save(tmp_path, HEAD + "[lengths]\nelbow-wrist = 25\nright_hip-left_hip = 20\n")
    ).lengths
    assert lengths == {
        "right_elbow-right_wrist": 0.25,
        "left_elbow-left_wrist": 0.25,
        "right_hip-left_hip": 0.2,
    }
    assert set(BOTH_SIDES) >= {"shoulder-elbow", "hip-knee", "knee-ankle", "neck-shoulder", "pelvis-hip"}


def test_sides_may_differ(tmp_path: Path) -> None:
    text = HEAD + '[lengths]\n"left_elbow-left_wrist" = 25.5\n"right_elbow-right_wrist" = 24\n'
    lengths = read_lengths(save(tmp_path, text)).lengths
    assert lengths["left_elbow-left_wrist"] == 0.255 and lengths["right_elbow-right_wrist"] == 0.24
    figure = load_figure().scaled(lengths)
    assert figure.lengths["left_elbow-left_wrist"] == pytest.approx(0.255)
    assert figure.lengths["neck-pelvis"] == pytest.approx(load_figure().lengths["neck-pelvis"])


def test_json_and_views(tmp_path: Path) -> None:
    document = {"schema": "posekit.lengths/1", "unit": "mm", "lengths": {"neck-pelvis": 500}, "stature": 1800}
    back = read_lengths(save(tmp_path, json.dumps(document), "a.json"))
    assert dict(back.lengths) == {"neck-pelvis": 0.5} and back.stature == 1.8
    view = {
        "schema": "posekit.view/1",
        "unit": "cm",
        "figure": {"lengths": {"neck-pelvis": 51}, "stature": 178},
    }
    back = read_lengths(save(tmp_path, json.dumps(view), "view.json"))
    assert dict(back.lengths) == {"neck-pelvis": 0.51} and back.stature == 1.78 and "view.json" in back.source
    with pytest.raises(InputError, match=r"figure\.lengths"):
        read_lengths(save(tmp_path, '{"schema": "posekit.view/1", "unit": "m"}', "view.json"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = 1", "schema"),
        ('schema = "posekit.lengths/1"\n[lengths]\n"neck-pelvis" = 0.5', "unit"),
        (HEAD.replace("cm", "inch") + '[lengths]\n"neck-pelvis" = 20', "unit"),
        (HEAD, "no length"),
        (HEAD + "[lengths]\n", "no length"),
        (HEAD + "lengths = 3", "lengths: got 3; expected an object"),
        (HEAD + '[lengths]\n"neck-pelvi" = 50', "neck-pelvis"),
        (HEAD + '[lengths]\n"neck-pelvis" = 0', "positive"),
        (HEAD + '[lengths]\n"neck-pelvis" = -3', "positive"),
        (HEAD + '[lengths]\n"neck-pelvis" = true', "positive"),
        (HEAD + '[lengths]\n"neck-pelvis" = "50"', "positive"),
        (HEAD + '[lengths]\n"neck-pelvis" = nan', "finite"),
        (HEAD + '[lengths]\n"neck-pelvis" = 500', "the unit"),
        (HEAD + '[lengths]\nelbow-wrist = 25\n"left_elbow-left_wrist" = 25', "twice"),
        (HEAD + '[lengths]\n"neck-pelvis" = 50\n[deviation]\n"elbow-wrist" = 1', "without its length"),
        (HEAD + 'stature = "tall"\n[lengths]\n"neck-pelvis" = 50', "stature"),
        (
            HEAD + 'colour = "red"\n[lengths]\n"neck-pelvis" = 50',
            "colour: got .* expected no field of this name",
        ),
        ("[[", "TOML"),
    ],
)
def test_damaged_files_are_refused_on_one_line(text: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says) as refused:
        read_lengths(save(tmp_path, text))
    assert "\n" not in str(refused.value)


def test_other_endings_and_units_are_refused(tmp_path: Path) -> None:
    lengths = SegmentLengths(lengths={"neck-pelvis": 0.5}, deviation={}, source="tape")
    with pytest.raises(InputError, match="ending"):
        write_lengths(tmp_path / "x.json", lengths)
    with pytest.raises(InputError, match="unit"):
        write_lengths(tmp_path / "x.toml", lengths, unit="inch")
    with pytest.raises(InputError, match="ending"):
        read_lengths(tmp_path / "x.csv")
    with pytest.raises(InputError, match="object"):
        read_lengths(save(tmp_path, "[]", "a.json"))


@pytest.mark.parametrize(
    ("lengths", "deviation"),
    [({"neck": 0.5}, {}), ({"neck-pelvis": math.nan}, {}), ({"neck-pelvis": 0.5}, {"neck-pelvis": -1.0})],
)
def test_impossible_lengths_are_refused(lengths: dict[str, float], deviation: dict[str, float]) -> None:
    with pytest.raises(FigureError, match=r"figure\.lengths"):
        SegmentLengths(lengths=lengths, deviation=deviation, source="x")
