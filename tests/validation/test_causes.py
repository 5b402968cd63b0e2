"""What follows from another finding is listed after it."""

import pytest

from posekit.formats.own.report_clips import Span
from posekit.formats.own.report_schema import Verdict
from posekit.validation.causes import NEAR_FRAMES, follows


def span(check: str, first: int, last: int, verdict: Verdict = "invalid") -> Span:
    return Span(
        check=check,
        where="",
        unit="1",
        verdict=verdict,
        first=first,
        last=last,
        start=None,
        end=None,
        frames=last - first + 1,
        worst_frame=first,
    )


@pytest.mark.parametrize(
    ("cause", "after"), [("swap", "joint_range"), ("swap", "jitter"), ("joint_range", "jitter")]
)
def test_what_is_near_its_cause_follows_from_it_and_what_is_far_does_not(cause: str, after: str) -> None:
    spans = [
        span(after, 200, 210),
        span(cause, 30, 40),
        span(after, 41 + NEAR_FRAMES, 90),
        span(after, 20, 35),
    ]
    assert follows(spans).tolist() == [False, False, False, True]


def test_nothing_follows_from_what_is_undecided_or_from_its_own_kind() -> None:
    assert not follows(
        [span("swap", 0, 9, "undecided"), span("joint_range", 0, 9), span("collision", 0, 9)]
    ).any()
    assert not follows([]).any()
