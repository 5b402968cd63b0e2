"""A set of postures as trunks and limbs holds the whole bodies that it was made of."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import posekit
from posekit.errors import InputError
from posekit.formats.own.frame_answer import FrameAnswer
from posekit.formats.own.frame_tables import table_arrays
from posekit.formats.own.posture_set import PostureSet
from posekit.formats.own.view import View
from posekit.geometry import Array
from posekit.skeleton import LIMB_JOINTS
from tests.frame_answers import bare_answer


def bodies_of(trunks: Array, limbs: Array, chosen: list[tuple[int, ...]]) -> Array:
    """Put together trunks (T, 14, 3) and on each the limbs (T, 4, K, 2, 3) that are chosen."""
    joints = np.stack([trunks[one[0]] for one in chosen]) if chosen else np.empty((0, 14, 3))
    for row, (trunk, *own) in enumerate(chosen):
        for kind, which in enumerate(own):
            joints[row, list(LIMB_JOINTS[kind][1:])] = limbs[trunk, kind, which]
    return joints


def rows_of(joints: Array) -> set[bytes]:
    return {one.tobytes() for one in joints}


ALL_BODIES = [one for one in product(range(3), *[range(3)] * 4)]
PAIRS = [((a, i), (b, j)) for a in range(4) for b in range(a + 1, 4) for i in range(3) for j in range(3)]
DRAWN = np.random.default_rng(7)
TRUNKS, LIMBS = DRAWN.normal(size=(3, 14, 3)), DRAWN.normal(size=(3, 4, 3, 2, 3))


@given(chosen=st.lists(st.sampled_from(ALL_BODIES), max_size=40))
def test_a_set_holds_the_bodies_that_it_was_made_of(chosen: list[tuple[int, ...]]) -> None:
    joints = bodies_of(TRUNKS, LIMBS, chosen)
    made = PostureSet.of(joints)
    listed = made.compose()
    assert made.bodies == len(listed) == len(rows_of(made.joints(listed)))
    assert rows_of(made.joints(listed)) >= rows_of(joints)
    assert len(made.trunks) == len({one[0] for one in chosen})


@given(
    barred=st.lists(st.tuples(st.integers(0, 2), st.sampled_from(PAIRS)), max_size=25),
    limbs=st.lists(st.integers(1, 3), min_size=12, max_size=12),
)
def test_what_pairs_of_limbs_exclude_is_told_exactly(
    barred: list[tuple[int, tuple[tuple[int, int], tuple[int, int]]]], limbs: list[int]
) -> None:
    chosen = [
        one
        for one in ALL_BODIES
        if all(one[1 + kind] < limbs[4 * one[0] + kind] for kind in range(4))
        and not any(
            one[0] == trunk and one[1 + a] == i and one[1 + b] == j for trunk, ((a, i), (b, j)) in barred
        )
    ]
    joints = bodies_of(TRUNKS, LIMBS, chosen)
    made = PostureSet.of(joints)
    assert rows_of(made.joints(made.compose())) == rows_of(joints)
    assert made.bodies == len(chosen)


def test_a_triple_that_is_missing_is_in_the_set_all_the_same() -> None:
    chosen = [one for one in ALL_BODIES if one[0] == 0 and max(one) < 2 and one[1:4] != (1, 1, 1)]
    made = PostureSet.of(bodies_of(TRUNKS, LIMBS, chosen))
    assert not len(made.excluded)
    assert made.bodies == len(chosen) + 2


def test_joints_that_are_not_known_are_limbs_like_others() -> None:
    limbs = LIMBS.copy()
    limbs[:, 1, :, 1] = np.nan
    joints = bodies_of(TRUNKS, limbs, [(0, 0, 0, 0, 0), (0, 1, 0, 0, 0), (0, 1, 0, 1, 0)])
    made = PostureSet.of(joints)
    assert made.bodies == 3 and len(made.limb_trunk) == 6
    np.testing.assert_array_equal(made.joints(made.compose())[0], joints[0])


def test_the_set_of_an_exact_frame_has_its_survivors(walking: View) -> None:
    for frame in posekit.recover(walking).frames:
        assert len(frame)
        made = PostureSet.of(frame.joints)
        assert rows_of(made.joints(made.compose())) >= rows_of(frame.joints)
        assert np.isnan(made.chi2(made.compose())).all()


def test_what_limbs_add_is_added_to_their_trunk() -> None:
    joints = bodies_of(TRUNKS, LIMBS, ALL_BODIES[:81])
    made = PostureSet.of(joints)
    fields = {name: getattr(made, name) for name in ("trunks", "limb_trunk", "limb_kind", "limb_joints")}
    weighed = PostureSet(
        **fields,
        trunk_chi2=np.array([10.0]),
        limb_chi2=np.arange(12.0),
        excluded=made.excluded,
        bodies=81,
    )
    listed = weighed.compose()
    assert weighed.chi2(listed)[0] == 10 + 0 + 3 + 6 + 9
    assert weighed.chi2(listed)[-1] == 10 + 2 + 5 + 8 + 11


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"trunk_chi2": np.zeros(2)}, r"set.trunk_chi2: got shape \(2,\); expected shape \(1,\)"),
        ({"limb_kind": np.full(12, 4)}, "set.limb_kind: got 4 to 4; expected 0 to 3"),
        ({"limb_trunk": np.ones(12)}, "set.limb_trunk: got 1 to 1; expected 0 to 0"),
        ({"excluded": [[0, 1]]}, "set.excluded: got another pair; expected pairs of limbs of two kinds"),
        ({"excluded": [[4, 1]]}, "the lower first"),
        ({"bodies": -1}, "set.bodies: got -1; expected a count from 0"),
    ],
)
def test_sets_that_are_none_are_refused(change: dict[str, object], message: str) -> None:
    made = PostureSet.of(bodies_of(TRUNKS, LIMBS, ALL_BODIES[:81]))
    with pytest.raises(InputError, match=message):
        PostureSet(**{name: getattr(made, name) for name in vars(made)} | change)


@pytest.mark.parametrize("last", [126, 127, 128, 129, 32767, 32768, 40000])
def test_numbers_of_an_npz_hold_the_largest_of_them(last: int) -> None:
    arrays = table_arrays(
        FrameAnswer, [bare_answer([0, last]), None], "m", within="answer/", precision=[None, None]
    )
    rows = arrays["answer/representatives"].rows
    assert rows[0].tolist() == [0, last]
    assert rows[0].itemsize <= (1 if last < 128 else 2 if last < 32768 else 4)
