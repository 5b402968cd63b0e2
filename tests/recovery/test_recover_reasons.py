"""Groups of survivors, the finding that killed each pruned branch, and what the result keeps of them."""

from itertools import pairwise

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS
from posekit.synthesis import (
    random_views,
)
from posekit.views.builtin import builtin_view, view_of

FIGURE = load_figure()
SEQ1 = builtin_view("seq1")
ALL = ("rigid-parts", "joint-range", "collision", "walking")


@pytest.mark.parametrize("radius", [0.02, 0.05, 0.15])
def test_groups_are_about_their_representatives(radius: float) -> None:
    recovery = recover(view_of(random_views(FIGURE, 20, np.random.default_rng(8))), group=radius)
    for frame in recovery.frames:
        assert frame.groups is not None
        first = {int(group): k for k, group in reversed(list(enumerate(frame.groups)))}
        leaders = frame.joints[[first[int(group)] for group in frame.groups]]
        assert np.linalg.norm(frame.joints - leaders, axis=-1).max(initial=0) <= radius
        heads = frame.joints[sorted(first.values())]
        apart = np.linalg.norm(heads[:, None] - heads, axis=-1).max(axis=-1)
        assert (apart[~np.eye(len(heads), dtype=bool)] > radius).all()


def test_without_a_radius_there_are_no_groups() -> None:
    assert recover(SEQ1).frames[0].groups is None


def test_every_pruned_branch_tells_the_finding_that_killed_it() -> None:
    recovery = recover(SEQ1, checks=ALL)
    for frame in recovery.frames:
        pruned = frame.pruned()
        lost: dict[str, int] = {}
        for branch in pruned:
            outside = branch.value < branch.lower or branch.value > branch.upper
            assert outside or branch.reason.startswith(("coincident/", "missing/", "behind_camera/"))
            assert branch.joint == JOINTS[len(branch.branch)]
            assert branch.unit in ("m", "deg")
            assert branch.unit == ("deg" if branch.reason.startswith("joint_range") else "m")
            lost[branch.reason] = lost.get(branch.reason, 0) + 2 ** (13 - len(branch.branch))
        assert lost == dict(frame.rejected)
        prefixes = sorted(branch.branch for branch in pruned)
        # No branch is pruned below one that was pruned already, and no survivor either.
        assert not any(b.startswith(a) for a, b in pairwise(prefixes))
        assert not any(code.startswith(prefix) for code in frame.branches for prefix in prefixes)


def test_margins_of_survivors_are_not_negative() -> None:
    recovery = recover(view_of(random_views(FIGURE, 30, np.random.default_rng(10))), checks=ALL)
    allowed = {"rigid_parts": 1e-12, "joint_range": 1e-3, "collision": 1e-9, "walking": 0.0}
    for frame in recovery.frames:
        assert set(frame.margins) == set(allowed)
        for name, values in frame.margins.items():
            assert values.shape == (len(frame),)
            decided = values[~np.isnan(values)]
            if name != "joint_range":
                assert (decided >= -allowed[name]).all()


def test_the_result_holds_what_the_recovery_does() -> None:
    recovery = recover(SEQ1, group=0.05)
    result = result_of(recovery, unit="cm", explain=True)
    for frame, written in zip(recovery.frames, result.frames, strict=True):
        assert np.array_equal(written.joints, frame.joints)
        assert np.array_equal(written.q, frame.q)
        assert list(written.branches) == frame.branches
        assert dict(written.rejected) == frame.rejected
        assert written.pruned is not None
        assert len(written.pruned) == len(frame.pruned())
        assert written.groups is not None
        assert written.levels["physical"] == tuple(frame.levels["physical"].tolist())
    assert result_of(recovery).frames[0].pruned is None
    assert result.settings == recovery.settings
