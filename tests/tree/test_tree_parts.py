"""The parts of a tree: codes, candidates, counts and losses of small trees, by brute force."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posekit.cameras import PinholeCamera, ScaledOrthographicCamera
from posekit.geometry import Array
from posekit.tree import Check, Findings, InterpretationTree, Leaves, Place
from posekit.tree.bits import path_of, select, support_of
from posekit.tree.candidates import BranchState, Candidates, lift_all
from posekit.tree.distinct import distinct, equal_pairs
from posekit.tree.enumeration import enumerate_leaves
from posekit.tree.factors import columns_of, factor_postures, whole_bodies
from posekit.tree.layout import point_tables
from posekit.tree.plain import apply, choices

CAMERA = PinholeCamera(K=np.array([[1000.0, 0.0, 320.0], [0.0, 1000.0, 240.0], [0.0, 0.0, 1.0]]))
JOINTS = ("root", "a", "b", "c", "d")
PARENTS = (-1, 0, 1, 0, 3)
"""Two limbs of two segments."""


def scene(frames: int = 3, seed: int = 1) -> tuple[Array, Array, Array]:
    """Return joints (F, 5, 3), their images and lengths (5, F, 1), each frame's own."""
    rng = np.random.default_rng(seed)
    joints = np.empty((frames, 5, 3))
    joints[:, 0] = [0.0, 0.0, 4.0]
    for joint in range(1, 5):
        joints[:, joint] = joints[:, PARENTS[joint]] + rng.uniform(-0.4, 0.4, (frames, 3))
    apart = joints[:, 1:] - joints[:, PARENTS[1:]]
    lengths = np.concatenate([np.zeros((1, frames)), np.linalg.norm(apart, axis=-1).T])
    return joints, CAMERA.project(joints), lengths[..., None]


def grown(frames: int = 3, checks: tuple[Check, ...] = ()) -> Leaves:
    joints, image, lengths = scene(frames)
    tree = InterpretationTree(joints=JOINTS, parents=PARENTS, lengths=lengths)
    return tree.grow(CAMERA, joints[:, 0], image, checks, tolerance=1e-9)


@dataclass(frozen=True, kw_only=True)
class Depth(Check):
    """That a point is no farther than so much, for tests."""

    points: tuple[int, ...]
    most: float
    name: str = "depth"
    unit: str = "m"

    @property
    def places(self) -> tuple[Place, ...]:
        return tuple(Place(name=f"point{k}") for k in self.points)

    def judge(self, points: Array) -> Findings:
        return Findings(value=points[..., 2], lower=np.array(-np.inf), upper=np.array(self.most))


# --- codes ----------------------------------------------------------------------------------------------


def test_paths_lead_to_joints() -> None:
    assert [path_of(joint, PARENTS) for joint in range(5)] == [(), (1,), (1, 2), (3,), (3, 4)]
    assert support_of((2, 4), PARENTS) == (1, 2, 3, 4) and support_of((0, 7), PARENTS) == ()
    assert support_of((4, 3), PARENTS) == (3, 4)


@given(level=st.integers(1, 7), data=st.data())
def test_bits_of_codes_are_picked_out(level: int, data: st.DataObject) -> None:
    joints = tuple(data.draw(st.lists(st.integers(1, level), unique=True, max_size=4)))
    table = select(level, joints)
    assert table.shape == (1 << level,) and not table.flags.writeable
    for code in range(1 << level):
        bits = f"{code:0{level}b}"
        assert table[code] == int("".join(bits[joint - 1] for joint in joints) or "0", 2)


@given(left=st.lists(st.integers(0, 4), max_size=8), right=st.lists(st.integers(0, 4), max_size=8))
def test_equal_entries_are_paired_in_order(left: list[int], right: list[int]) -> None:
    found = equal_pairs(np.array(left, dtype=np.intp), np.array(right, dtype=np.intp))
    expected = [(i, j) for i, a in enumerate(left) for j, b in enumerate(right) if a == b]
    assert list(zip(found[0].tolist(), found[1].tolist(), strict=True)) == expected


@given(
    rows=st.lists(
        st.lists(st.sampled_from([0.0, 1.0, np.nan]), min_size=3, max_size=3), min_size=1, max_size=12
    )
)
def test_rows_are_the_same_to_the_last_bit(rows: list[list[float]]) -> None:
    table = np.array(rows)
    one, which = distinct(table)
    kinds = {str(row) for row in rows}
    assert len(one) == len(kinds)
    np.testing.assert_array_equal(table[one[which]], table)


def test_rows_that_differ_by_the_last_bit_alone_are_told_apart_and_no_others() -> None:
    rng = np.random.default_rng(4)
    rows = rng.standard_normal((200, 18))
    beside = rows.copy()
    beside[:, 7] = np.nextafter(beside[:, 7], np.inf)
    kinds = np.concatenate([rows, beside])
    table = np.repeat(kinds, 3, axis=0)
    one, which = distinct(table)
    assert len(one) == len(kinds)
    np.testing.assert_array_equal(table[one[which]], table)


# --- candidates -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("pinhole", [True, False])
def test_candidates_are_the_lifts_of_each_path(pinhole: bool) -> None:
    joints, image, lengths = scene()
    camera = CAMERA if pinhole else ScaledOrthographicCamera(scale=300.0)
    image = image if pinhole else camera.project(joints)
    given_ = np.arange(6.0).reshape(3, 2, 1) + np.zeros((3, 2, 3))
    found = lift_all(
        camera, joints[:, 0], image, parents=PARENTS, lengths=lengths, tolerance=1e-9, given=given_
    )
    assert found.first == (0, 1, 3, 7, 9, 13)
    assert found.table.shape == (3, 13 + 2 + 1, 3) and np.isnan(found.table[:, -1]).all()
    np.testing.assert_array_equal(found.table[:, 13:15], given_)
    np.testing.assert_array_equal(found.positions[0][:, 0], joints[:, 0])
    for joint in range(1, 5):
        start = found.positions[PARENTS[joint]]
        lift = camera.lift(
            start, np.repeat(image[:, joint, None], start.shape[1], axis=1), lengths[joint], tolerance=1e-9
        )
        valid = lift.valid.reshape(3, -1)
        np.testing.assert_array_equal(found.branches[joint] == BranchState.OPEN, valid)
        np.testing.assert_allclose(
            found.positions[joint][valid], lift.points.reshape(3, -1, 3)[valid], atol=1e-12
        )
        assert np.isnan(found.positions[joint][~valid]).all()
        np.testing.assert_allclose(found.excess[joint], np.repeat(lift.excess, 2, axis=1), atol=1e-12)
        away = np.linalg.norm(found.positions[joint] - joints[:, joint, None], axis=-1)
        assert np.nanmin(away, axis=1).max() < 1e-6


def test_each_choice_that_is_excluded_says_why() -> None:
    joints, image, lengths = scene(1)
    near = joints[:, 0]
    for change, state in (
        ({"length": 0.5}, [BranchState.NO_SOLUTION] * 2),
        ({"tangent": True}, [BranchState.OPEN, BranchState.COINCIDENT]),
        ({"missing": True}, [BranchState.OPEN, BranchState.MISSING]),
        ({"length": 100.0}, [BranchState.BEHIND_CAMERA, BranchState.OPEN]),
    ):
        own, pixels = lengths.copy(), image.copy()
        ray = np.append((pixels[0, 1] - [320.0, 240.0]) / 1000.0, 1.0)
        ray /= np.linalg.norm(ray)
        height = np.linalg.norm(near[0] - (near[0] @ ray) * ray)
        own[1] = height * float(change.get("length", 1.0))
        if "missing" in change:
            pixels[0, 1] = np.nan
        found = lift_all(CAMERA, near, pixels, parents=PARENTS, lengths=own, tolerance=1e-9)
        assert found.branches[1][0].tolist() == state
        if state[0] is BranchState.NO_SOLUTION:
            joint, by = found.too_short(0) or (0, 0.0)
            assert joint == 1 and by == pytest.approx(height / 2)
        else:
            assert (found.too_short(0) or (2, 0.0))[0] != 1
    assert Candidates.start(near, PARENTS, None).table.shape == (1, 14, 3)


def test_all_leaves_of_a_small_tree_are_enumerated() -> None:
    joints, image, lengths = scene()
    for frame in range(3):
        leaves, codes = enumerate_leaves(
            CAMERA,
            joints[frame, 0],
            image[frame],
            parents=PARENTS,
            lengths=lengths[:, frame, 0],
            tolerance=1e-9,
        )
        tree = grown()
        mine = tree.frame == frame
        np.testing.assert_array_equal(codes, tree.code[mine])
        np.testing.assert_allclose(leaves, tree.postures()[mine], atol=1e-9)
        assert np.abs(leaves - joints[frame]).max(axis=(1, 2)).min() < 1e-6
        np.testing.assert_allclose(
            CAMERA.project(leaves), np.tile(image[frame], (len(leaves), 1, 1)), atol=1e-6
        )


# --- leaves ---------------------------------------------------------------------------------------------


def test_leaves_say_where_they_are() -> None:
    leaves = grown()
    assert leaves.n_frames == 3 and leaves.level == 4
    assert leaves.branches() == [f"{code:04b}" for code in leaves.code]
    nodes = np.arange(len(leaves.code))
    places = leaves.positions((2, 0, 9), nodes)
    np.testing.assert_array_equal(places[:, :2], leaves.postures()[:, [2, 0]])
    assert np.isnan(places[:, 2]).all()
    starts = leaves.offsets()
    assert starts[0] == 0 and starts[-1] == len(leaves.code)
    for frame in range(3):
        assert (leaves.frame[starts[frame] : starts[frame + 1]] == frame).all()
    counts = leaves.counts()
    for frame, level in product(range(3), range(5)):
        prefixes = {
            text[:level] for text, of in zip(leaves.branches(), leaves.frame, strict=True) if of == frame
        }
        assert counts[frame, level] == len(prefixes)
    rows, place = leaves.alike((2,))
    np.testing.assert_array_equal(leaves.positions((2,), rows)[place], leaves.positions((2,), nodes))
    assert len(rows) == len(
        {(f, t[:2]) for f, t in zip(leaves.frame.tolist(), leaves.branches(), strict=True)}
    )
    roots = leaves.at(0, np.arange(3, dtype=np.int32), np.zeros(3, dtype=np.int32))
    assert roots.branches() == ["", "", ""] and roots.counts()[:, 0].tolist() == [1, 1, 1]
    assert (leaves.length_residual() < 1e-8).all()


def test_a_tree_of_a_root_alone_is_the_root() -> None:
    tree = InterpretationTree(joints=("root",), parents=(-1,), lengths=np.zeros(1))
    root = np.array([[0.0, 0.0, 4.0], [0.0, 0.0, 5.0]])
    leaves = tree.grow(CAMERA, root, CAMERA.project(root)[:, None], (Depth(points=(0,), most=4.5),))
    np.testing.assert_array_equal(leaves.postures()[:, 0], root)


def test_a_segment_may_not_be_too_short_unless_told_otherwise() -> None:
    joints, image, lengths = scene(2)
    ray = np.concatenate([(image[:, 1] - [320.0, 240.0]) / 1000.0, np.ones((2, 1))], axis=1)
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    along = np.einsum("fi,fi->f", joints[:, 0], ray)
    lengths[1, :, 0] = np.linalg.norm(joints[:, 0] - along[:, None] * ray, axis=1) - [1e-4, -1e-4]
    tree = InterpretationTree(joints=JOINTS[:2], parents=PARENTS[:2], lengths=lengths[:2])
    assert set(tree.grow(CAMERA, joints[:, 0], image[:, :2], ()).frame.tolist()) == {1}
    assert set(tree.grow(CAMERA, joints[:, 0], image[:, :2], (), tolerance=2e-4).frame.tolist()) == {0, 1}


def test_what_is_lost_and_what_is_left_are_enumerate_leaves() -> None:
    most = 4.05
    full, pruned = (
        grown(),
        grown(checks=(Depth(points=(1, 3), most=most), Depth(points=(2,), most=most, name="two"))),
    )
    postures = full.postures()
    kept = (postures[:, 1:4, 2] <= most).all(axis=1)
    np.testing.assert_array_equal(pruned.code, full.code[kept])
    np.testing.assert_array_equal(pruned.frame, full.frame[kept])
    for frame, reasons in enumerate(pruned.rejected()):
        assert sum(reasons.values()) + np.count_nonzero(pruned.frame == frame) == 16
    for group in pruned.pruned:
        if group.check in ("depth", "two"):
            assert group.unit == "m" and (group.value > group.upper).all() and (group.upper == most).all()
            assert np.isneginf(group.lower).all()
            assert group.level == (3 if group.check == "depth" else 2)
    # The first place that is violated is named.
    of_depth = [group for group in pruned.pruned if group.check == "depth"]
    if of_depth:
        (group,) = of_depth
        nodes = full.at(3, group.frame, group.code)
        places = nodes.positions((1, 3), np.arange(len(group.code)))[..., 2]
        np.testing.assert_array_equal(group.place, np.where(places[:, 0] > most, 0, 1))
        np.testing.assert_allclose(group.value, np.where(places[:, 0] > most, places[:, 0], places[:, 1]))


def test_a_check_is_asked_once_for_each_of_its_choices() -> None:
    leaves = grown()
    for points in ((2,), (1, 3), (0,), (4,)):
        nodes, row = choices(leaves, Depth(points=points, most=9.0))
        support = [joint - 1 for joint in support_of(points, PARENTS)]
        keys = [
            (frame, *(text[k] for k in support))
            for frame, text in zip(leaves.frame.tolist(), leaves.branches(), strict=True)
        ]
        assert len(nodes) == len(set(keys))
        assert [keys[nodes[k]] for k in row] == keys
        assert [keys[node] for node in nodes] == sorted(set(keys))
    # Of few nodes in a wide table likewise.
    last = np.flatnonzero(leaves.frame == 2)[:1]
    few = leaves.at(
        4,
        np.array([0, leaves.frame[last[0]]], dtype=np.int32),
        np.array([leaves.code[0], leaves.code[last[0]]], dtype=np.int32),
    )
    nodes, row = choices(few, Depth(points=(2, 4), most=9.0))
    assert nodes.tolist() == [0, 1] and row.tolist() == [0, 1]
    none = leaves.at(4, leaves.frame[:0], leaves.code[:0])
    assert apply(none, Depth(points=(2,), most=0.0)) is none
    assert len(apply(leaves, Depth(points=(0,), most=0.0)).code) == 0


# --- factors --------------------------------------------------------------------------------------------


def test_postures_are_put_together_from_their_trunks_and_limbs() -> None:
    rng = np.random.default_rng(2)
    trunks, limbs = rng.normal(size=(3, 6, 3)), [rng.normal(size=(4, 2, 3)) for _ in range(4)]
    trunk_of = rng.integers(0, 3, 40)
    limb_of = rng.integers(0, 4, (4, 40))
    frames = np.array([0, 0, 1])[trunk_of]
    bodies = whole_bodies(trunks, limbs, trunk_of, limb_of)
    found = factor_postures(frames, bodies)
    assert len(found.trunk) == len(set(trunk_of.tolist()))
    np.testing.assert_array_equal(bodies[found.trunk[found.trunk_of]][:, :6], bodies[:, :6])
    for kind in range(4):
        pairs = set(zip(trunk_of.tolist(), limb_of[kind].tolist(), strict=True))
        assert len(found.limb[kind]) == len(pairs)
        of_trunk = found.trunk_of[found.limb[kind]]
        assert (np.diff(of_trunk) >= 0).all()
        same = bodies[found.limb[kind][found.limb_of[kind]]]
        columns = {0: (6, 8), 1: (7, 9), 2: (10, 12), 3: (11, 13)}[kind]
        np.testing.assert_array_equal(same[:, columns], bodies[:, columns])


@given(bases=st.lists(st.lists(st.integers(0, 3), max_size=6).map(sorted), min_size=4, max_size=4))
def test_limbs_stand_side_by_side_on_their_bases(bases: list[list[int]]) -> None:
    found = columns_of([np.array(base, dtype=np.intp) for base in bases], 4)
    width = [max(base.count(k) for base in bases) for k in range(4)]
    assert found.base.tolist() == [k for k in range(4) for _ in range(width[k])]
    for kind, base in enumerate(bases):
        assert found.base[found.of[kind]].tolist() == base
        assert len(set(found.of[kind].tolist())) == len(base)
        first = [found.of[kind][k] for k in range(len(base)) if k == 0 or base[k] != base[k - 1]]
        assert [found.base.tolist().index(found.base[k]) for k in first] == [int(k) for k in first]
    assert found.used.sum(axis=1).tolist() == [len(base) for base in bases]


def test_points_of_a_check_are_found_by_paths_and_columns() -> None:
    tables = point_tables((2, 0, 4, 6), PARENTS, (0, 1, 3, 7, 9, 13), 15)
    assert tables.choices == 16
    assert sorted(zip(tables.tips.tolist(), tables.bits.tolist(), strict=True)) == [(2, 2), (4, 2)]
    assert tables.joints.tolist() == [2, 0, 4, 5] and tables.first.tolist() == [3, 0, 9, 14]
    beyond = point_tables((5, 9), PARENTS, (0, 1, 3, 7, 9, 13), 15)
    assert beyond.choices == 1 and beyond.first.tolist() == [13, 14] and beyond.tips.tolist() == []
