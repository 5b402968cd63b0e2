"""Linkages: what describes an object and what does not, their files, and their interpretation trees."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import InputError
from posekit.linkages import Linkage, linkage_names, linkage_of, load_linkage, span
from posekit.linkages.spanning import MAX_SEGMENTS
from posekit.safe_io import parse_toml
from posekit.tables.file_model import validated
from posekit.tables.linkage import LinkageTable

SQUARE = {("a", "b"): 1.0, ("b", "c"): 1.0, ("c", "d"): 1.0, ("d", "a"): 1.0}
TABLE_1 = {
    ("elbow", "wrist"): 14,
    ("shoulder", "elbow"): 15,
    ("knee", "ankle"): 20,
    ("hip", "knee"): 19,
}


def make(segments: dict[tuple[str, str], float], **more: object) -> Linkage:
    return Linkage.from_names(name="thing", segments=segments, **more)  # type: ignore[arg-type]


def write(points: str, segments: str, more: str = "") -> str:
    return f'schema = "posekit.linkage/1"\npoints = {points}\n[segments]\n{segments}\n{more}'


def test_points_come_in_the_order_of_the_segments() -> None:
    linkage = make({("hip", "knee"): 2.0, ("knee", "ankle"): 1.0})
    assert linkage.points == linkage.nodes == ("hip", "knee", "ankle")
    assert linkage.segments == ((0, 1), (1, 2))
    assert linkage.segment_names == ("hip-knee", "knee-ankle")
    assert linkage.lengths.tolist() == [2.0, 1.0]


def test_a_segment_is_found_either_way_round() -> None:
    linkage = make({("hip", "knee"): 2.0, ("knee", "ankle"): 1.0})
    assert linkage.segment("knee-ankle") == linkage.segment("ankle-knee") == 1


def test_names_may_have_hyphens() -> None:
    linkage = Linkage.from_names(name="robot", points=["l-hip", "l-knee"], segments={"l-hip-l-knee": 1.0})
    assert linkage.segments == ((0, 1),)


def test_a_name_that_can_be_read_in_two_ways_is_refused() -> None:
    with pytest.raises(InputError, match="can be read in 2 ways"):
        Linkage.from_names(name="robot", points=["a", "b-c", "a-b", "c"], segments={"a-b-c": 1.0})


def test_lengths_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        make(SQUARE).lengths[0] = 2.0


def test_a_midpoint_is_seen_in_the_middle() -> None:
    linkage = make({("a", "b"): 2.0, ("m", "c"): 1.0}, midpoints={"m": ("a", "b")})
    assert linkage.points == ("a", "b", "c")
    assert linkage.nodes == ("a", "b", "c", "m")
    placed = linkage.place_nodes(np.array([[0.0, 0.0], [4.0, 2.0], [9.0, 9.0]]))
    np.testing.assert_array_equal(placed[3], [2.0, 1.0])


# --- what is no object ------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_segment_without_length_is_refused(length: float) -> None:
    with pytest.raises(InputError, match=r"segment b-c has length (0|-1|nan|inf); expected a finite length"):
        make({("a", "b"): 1.0, ("b", "c"): length})


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_a_length_beyond_all_measure_is_refused(length: float) -> None:
    with pytest.raises(InputError, match=r"b-c has length 1e[-+]200; expected one from 1e-12 to 1e\+12"):
        make({("a", "b"): 1.0, ("b", "c"): length})


def test_an_object_too_large_is_refused() -> None:
    with pytest.raises(InputError, match="601 points; expected at most 500"):
        make({(f"p{k}", f"p{k + 1}"): 1.0 for k in range(600)})
    with pytest.raises(InputError, match="2016 segments; expected at most 2000"):
        make({(f"p{a}", f"p{b}"): 1.0 for a in range(64) for b in range(a)})


def test_an_object_in_parts_is_refused_and_the_parts_are_named() -> None:
    with pytest.raises(InputError, match=r"falls into 2 parts, \(a, b\) and \(c, d, e\)"):
        make({("a", "b"): 1.0, ("c", "d"): 1.0, ("d", "e"): 1.0})


def test_a_point_of_no_segment_is_a_part_of_its_own() -> None:
    with pytest.raises(InputError, match=r"falls into 2 parts, \(a, b\) and \(c\)"):
        make({("a", "b"): 1.0}, points=["a", "b", "c"])


@pytest.mark.parametrize("longest", [3.001, 100.0])
def test_a_loop_that_cannot_close_is_refused_and_the_segment_is_named(longest: float) -> None:
    with pytest.raises(
        InputError, match=r"the loop d-c-b-a-d cannot close: d-a is .* long, the others together 3"
    ):
        make({**SQUARE, ("d", "a"): longest})


def test_a_loop_that_closes_only_flat_is_allowed() -> None:
    assert make({**SQUARE, ("d", "a"): 3.0}).lengths[3] == 3.0
    thirds = {("a", "b"): 0.1, ("b", "c"): 0.2, ("a", "c"): 0.3}  # 0.1 + 0.2 > 0.3 in the last bit
    assert len(make(thirds).segments) == 3
    assert len(make({("a", "b"): 0.1, ("b", "c"): 0.7, ("a", "c"): 0.8}).segments) == 3  # and 0.1 + 0.7 < 0.8


def test_a_diagonal_longer_than_the_way_round_is_refused() -> None:
    with pytest.raises(InputError, match=r"cannot close: a-c is 2\.1 long, the others together 2"):
        make({**SQUARE, ("a", "c"): 2.1})


def test_a_loop_through_a_midpoint_must_close_too() -> None:
    segments = {("a", "b"): 2.0, ("m", "c"): 1.0, ("c", "a"): 2.1}
    with pytest.raises(InputError, match=r"cannot close: c-a is 2\.1 long, the others together 2"):
        make(segments, midpoints={"m": ("a", "b")})
    assert make({**segments, ("c", "a"): 1.9}, midpoints={"m": ("a", "b")}).segments[2] == (2, 0)


def test_a_segment_given_twice_is_refused() -> None:
    with pytest.raises(InputError, match="segment b-a is given twice"):
        make({("a", "b"): 1.0, ("b", "a"): 1.0})


def test_a_segment_from_a_point_to_itself_is_refused() -> None:
    with pytest.raises(InputError, match="segment a-a begins and ends at one point"):
        make({("a", "a"): 1.0, ("a", "b"): 1.0})


def test_half_a_segment_cannot_be_given_a_length_of_its_own() -> None:
    with pytest.raises(InputError, match="segment a-m is half of another one"):
        make({("a", "b"): 1.0, ("a", "m"): 0.4}, midpoints={"m": ("a", "b")})


def test_a_midpoint_of_no_segment_is_refused() -> None:
    with pytest.raises(InputError, match="midpoint m is of no segment: a-c is not given"):
        make({("a", "b"): 1.0, ("b", "c"): 1.0, ("m", "d"): 1.0}, midpoints={"m": ("a", "c")})


def test_a_midpoint_of_a_midpoint_is_refused() -> None:
    middles = {"m": ("a", "b"), "n": ("a", "m")}
    with pytest.raises(InputError, match="midpoint n must lie between two points"):
        make({("a", "b"): 1.0, ("n", "c"): 1.0}, midpoints=middles)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"coplanar": [["a", "b", "c"]]}, "coplanar a, b, c: 3 points always are; expected at least 4"),
        ({"coplanar": [["a", "b", "c", "a"]]}, "a point is given twice"),
        ({"coplanar": [["a", "b", "c", "x"]]}, "no point x"),
        ({"collinear": [["a", "b"]]}, "2 points; expected 3"),
        ({"perpendicular": [("a-b", "a-b")]}, "not perpendicular to itself"),
        ({"perpendicular": [("a-b", "a-c")]}, "a-c is not one of its segments; they are a-b, b-c, c-d, d-a"),
        (
            {"perpendicular": [("a-b", "b-c")], "collinear": [["a", "b", "c"]]},
            "cannot be perpendicular and on one line",
        ),
        ({"unit": 0.0}, "unit is 0; expected a finite positive number"),
        ({"height": np.nan}, "height is nan; expected a finite positive number"),
        ({"points": ["a", "b", "c", "d", "d"]}, "point d is given twice"),
        ({"points": ["a", "b", "c", "d", ""]}, "is no name for a point"),
        ({"points": ["a", "b", "c", "d", "e\n"]}, r"'e\\\\n' is no name for a point"),
        ({"points": ["a", "b", "c"]}, "there is no point d; expected a, b, c"),
    ],
)
def test_impossible_constraints_and_names_are_refused(more: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        make(SQUARE, **more)
    assert "\n" not in str(raised.value)


def test_three_points_whose_distances_make_a_triangle_are_not_collinear() -> None:
    triangle = {("a", "b"): 1.0, ("b", "c"): 1.0, ("a", "c"): 1.9}
    with pytest.raises(InputError, match=r"their distances 1, 1 and 1\.9 make a triangle"):
        make(triangle, collinear=[["a", "b", "c"]])
    assert make({**triangle, ("a", "c"): 2.0}, collinear=[["a", "b", "c"]]).collinear == ((0, 1, 2),)


def test_a_name_that_is_nearly_right_is_suggested() -> None:
    with pytest.raises(InputError, match=r"no point right_elbwo; did you mean right_elbow"):
        Linkage.from_names(
            name="arm", points=["right_elbow", "right_wrist"], segments={"right_elbwo-right_wrist": 1.0}
        )


# --- files ------------------------------------------------------------------------------------------------


def test_the_built_in_linkages_load() -> None:
    assert {"four_bar", "planar_chain", "taylor_human"} <= set(linkage_names())
    for name in linkage_names():
        assert load_linkage(name).name == name


def test_taylors_human_is_table_1() -> None:
    human = load_linkage("taylor_human")
    lengths = dict(zip(human.segment_names, human.lengths, strict=True))
    for side in ("right", "left"):
        for (a, b), length in TABLE_1.items():
            assert lengths.pop(f"{side}_{a}-{side}_{b}") == length
    assert lengths == {
        "right_shoulder-left_shoulder": 18,
        "right_hip-left_hip": 14,
        "mid_shoulders-mid_hips": 24,
    }
    assert (len(human.points), len(human.segments), human.height) == (12, 11, 70)


def test_the_objects_of_figures_7_and_8() -> None:
    closed, chain = load_linkage("four_bar"), load_linkage("planar_chain")
    assert len(span(closed).chords) == 1
    assert len(span(chain).chords) == 0
    assert [len(group) for group in chain.coplanar] == [4]


def test_a_linkage_is_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "hinge.toml"
    constraints = '[constraints]\nperpendicular = [["a-b", "b-c"]]'
    path.write_text(write('["a", "b", "c"]', "a-b = 2\nb-c = 0.5", constraints))
    hinge = load_linkage(path)
    assert hinge.name == "hinge"
    assert hinge.lengths.tolist() == [2.0, 0.5]
    assert hinge.perpendicular == ((0, 1),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('schema = "posekit.ranges/1"', r'schema: got "posekit\.ranges/1"; expected "posekit\.linkage/1"'),
        ("", "schema: got nothing"),
        ("points = [", "not TOML"),
        (write('["a", "b"]', "a-b = nan"), r"segments\.a-b: got nan"),
        (write('["a", "b"]', "a-b = 0"), "segment a-b has length 0"),
        (write('["a", "b"]', 'a-b = "1"'), r'segments\.a-b: got "1"; expected a number'),
        (write('["a", "b"]', "a-b = true"), r"segments\.a-b: got true; expected a number"),
        (write('["a", "b"]', "a-x = 1"), "there is no point x; expected a, b"),
        (write('["a", "b"]', "ab = 1"), "segment ab; expected two points joined by a hyphen"),
        (write('["a", 1]', "a-b = 1"), r"points\[1\]: got 1; expected a text"),
        (write('["a", "b"]', "a-b = 1", "[constraint]"), r"constraint: .* did you mean constraints\?"),
        (write('["a", "b"]', "a-b = 1", "[constraints]\nplanar = []"), r"constraints\.planar"),
        (
            write('["a", "b"]', "a-b = 1", '[midpoints]\nm = ["a"]'),
            r'midpoints\.m: got \["a"\]; expected at least 2 entries',
        ),
        (write('["a", "b"]', "a-b = 1", '[midpoints]\nm = ["a", "c"]'), "there is no point c"),
        (
            'schema = "posekit.linkage/1"\npoints = ["a", "b"]',
            r"segments: got nothing; expected this field; give the lengths under \[segments\]",
        ),
        (
            'schema = "posekit.linkage/1"\n[segments]\na-b = 1',
            "points: got nothing; expected this field",
        ),
    ],
)
def test_a_file_that_is_no_linkage_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        linkage_of(validated(LinkageTable, parse_toml(text, "bad.toml"), "bad.toml"), "bad.toml")
    assert str(raised.value).startswith("bad.toml: ")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["taylor_humam", "", "a\0b", "x" * 5000])
def test_an_unknown_name_lists_those_that_are_there(name: str) -> None:
    with pytest.raises(InputError, match=r"four_bar, planar_chain.*taylor_human or a TOML file"):
        load_linkage(name)


def test_a_large_file_and_a_directory_are_refused(tmp_path: Path) -> None:
    large = tmp_path / "large.toml"
    large.write_bytes(b"#" * 1_000_001)
    with pytest.raises(InputError, match="expected at most 1 MB"):
        load_linkage(large)
    with pytest.raises(InputError, match="a directory"):
        load_linkage(tmp_path)


@given(st.text(max_size=200))
def test_no_text_makes_it_fail_in_another_way(text: str) -> None:
    for content in (text, f'schema = "posekit.linkage/1"\n{text}'):
        try:
            linkage_of(validated(LinkageTable, parse_toml(content, "fuzz.toml"), "fuzz.toml"), "fuzz.toml")
        except InputError as error:
            assert "\n" not in str(error)


# --- trees ------------------------------------------------------------------------------------------------


def test_a_chain_has_one_joint_a_point_and_no_chord() -> None:
    spanned = span(make({("a", "b"): 3.0, ("b", "c"): 2.0, ("b", "d"): 1.0}))
    assert spanned.tree.joints == ("a", "b", "c", "d")
    assert spanned.tree.parents == (-1, 0, 1, 1)
    assert spanned.tree.lengths.tolist() == [0.0, 3.0, 2.0, 1.0]
    assert spanned.chords == ()


def test_a_loop_is_spanned_breadth_first_and_has_one_chord() -> None:
    spanned = span(make({**SQUARE, ("c", "d"): 1.5}))
    assert spanned.tree.joints == ("a", "b", "d", "c")
    assert spanned.tree.parents == (-1, 0, 0, 1)
    assert spanned.chords == (2,)


def test_the_root_can_be_chosen() -> None:
    spanned = span(make(SQUARE), root="c")
    assert spanned.tree.joints[0] == "c"
    with pytest.raises(InputError, match="no point x"):
        span(make(SQUARE), root="x")


def test_taylors_human_spans_twelve_points_and_two_midpoints() -> None:
    spanned = span(load_linkage("taylor_human"))
    assert spanned.n_flips == 2048
    assert len(spanned.tree.joints) == 14
    assert spanned.chords == ()
    lengths = dict(zip(spanned.tree.joints, spanned.tree.lengths, strict=True))
    assert lengths["mid_shoulders"] == 9.0
    assert lengths["left_hip"] == 7.0


def test_points_and_images_go_into_the_trees_order_and_back(rng: np.random.Generator) -> None:
    human = load_linkage("taylor_human")
    for root in (None, "left_ankle", "mid_hips"):
        spanned = span(human, root)
        points = rng.normal(size=(5, 12, 3))
        placed = human.place_nodes(points)[:, list(spanned.nodes)]
        np.testing.assert_array_equal(spanned.points(placed), points)
        np.testing.assert_array_equal(spanned.place_image(points[..., :2]), placed[..., :2])


def test_a_tree_too_large_to_enumerate_is_refused() -> None:
    chain = make({(f"p{k}", f"p{k + 1}"): 1.0 for k in range(MAX_SEGMENTS + 1)})
    with pytest.raises(InputError, match=rf"{MAX_SEGMENTS + 1} segments to enumerate"):
        span(chain)


@pytest.mark.parametrize("n", [1, 2, 5, 10])
def test_n_free_segments_have_two_to_the_n_leaves(n: int) -> None:
    spanned = span(make({(f"p{k}", f"p{k + 1}"): 1.0 + k for k in range(n)}))
    image = np.zeros((1, n + 1, 2))
    leaves = spanned.grow(ScaledOrthographicCamera(scale=10.0), image)
    assert len(leaves.code) == 2**n == spanned.n_flips
    assert (spanned.points(leaves.postures())[:, 0] == 0).all()
