"""The page of a report, in a real browser: it loads nothing, names stay text, a span shows its frame."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from posekit.formats.own.report import ValidationReport
from posekit.formats.own.report_clips import ClipVerdict, Span, Still
from posekit.skeleton import JOINTS
from posekit.viewer.browser.browser import Browser
from posekit.viewer.plots.timeline_plot import plot_timelines, write_timelines
from posekit.viewer.report_page import write_report_page
from posekit.viewer.report_page.page_report import MOST_DETAILED_CLIPS, page_report

HOSTILE = "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=1>\u2028$x^{style}{data}"
MARK_RING = "[...document.querySelectorAll('.frame svg .mark')]"


@pytest.fixture(scope="module", params=[(1000, 800), (420, 800)], ids=["wide", "narrow"])
def browser(request) -> Iterator[Browser]:
    with Browser(size=request.param) as started:
        yield started


def a_span(first: int, last: int, **changes) -> Span:
    given: dict[str, Any] = {
        "check": "speed",
        "where": "right_wrist",
        "unit": "m/s",
        "verdict": "invalid",
        "worst_frame": first,
        "places": ("right_wrist",),
    }
    given |= {"frames": last - first + 1, "first": first, "last": last, "start": first / 30, "end": last / 30}
    return Span(**given | {"value": 21.5, "bound": 15.0, "margin": -6.5} | changes)


def a_clip(name: str = HOSTILE, count: int = 2) -> ClipVerdict:
    silent = {
        "check": "collision",
        "where": "",
        "verdict": "undecided",
        "value": None,
        "bound": None,
        "places": (),
    }
    return ClipVerdict(
        file=name,
        clip="",
        verdict="invalid",
        frames=60,
        invalid=3,
        undecided=10,
        first_frame=5,
        first_by=("speed/right_wrist",),
        spans=[
            *(a_span(5 + 10 * k, 7 + 10 * k) for k in range(count)),
            a_span(40, 49, margin=None, **silent),
        ],
        good=(50, 59),
        seconds=2.0,
    )


def a_report(clips: int = 1) -> ValidationReport:
    points = np.random.default_rng(3).normal(size=(14, 3)).astype(np.float32)
    points[2] = np.nan
    stills = tuple((Still(frame=5, points=points, before=points + 0.1),) for _ in range(clips))
    return ValidationReport(
        settings={"ranges": HOSTILE},
        postures=[],
        clips=[a_clip(f"{HOSTILE}{k}") for k in range(clips)],
        stills=stills,
    )


def test_a_click_on_a_span_shows_its_frame_and_marks_the_joint(browser, tmp_path):
    write_report_page(tmp_path / "r.html", a_report(), title=HOSTILE)
    browser.open(tmp_path / "r.html")
    assert browser.evaluate("typeof window.hacked") == "undefined"
    assert browser.evaluate("document.querySelector('h1').textContent") == HOSTILE
    assert browser.evaluate("document.querySelector('article h3').textContent").startswith(HOSTILE)
    assert browser.evaluate("document.querySelectorAll('article svg .span').length") == 3
    assert browser.evaluate("document.querySelector('.frame').hidden") is True
    browser.evaluate("document.querySelector('.span.invalid').dispatchEvent(new MouseEvent('click'))")
    facts = browser.evaluate("document.querySelector('.frame dl').textContent")
    assert "speed/right_wrist" in facts
    assert "21.5 m/s" in facts
    assert browser.evaluate(f"{MARK_RING}.length") == 1
    assert browser.evaluate("document.querySelectorAll('.frame svg line').length") > len(JOINTS)
    browser.evaluate("document.querySelectorAll('.spans button')[2].click()")
    assert browser.evaluate("document.querySelector('.frame').textContent").startswith(
        "This frame's joints are not"
    )
    assert "undecided" in browser.evaluate("document.querySelector('.frame dl').textContent")
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert browser.requests() == [(tmp_path / "r.html").as_uri()]


def test_all_spans_can_be_listed(browser, tmp_path):
    clip = a_clip(count=30)
    write_report_page(tmp_path / "r.html", ValidationReport(settings={}, postures=[], clips=[clip]))
    browser.open(tmp_path / "r.html")
    listed = "[...document.querySelectorAll('.spans button')].map(button => button.textContent)"
    assert browser.evaluate(f"{listed}.length") == 13
    browser.evaluate("document.querySelector('.spans button.soft').click()")
    names = browser.evaluate(listed)
    assert len(names) == len(clip.spans)
    browser.evaluate("[...document.querySelectorAll('.spans button')].at(-2).click()")
    assert browser.evaluate("document.querySelector('.frame dl').textContent.includes('295 to 297')")


def test_clips_are_chosen_by_check(browser, tmp_path):
    write_report_page(tmp_path / "r.html", a_report(3))
    browser.open(tmp_path / "r.html")
    assert browser.evaluate("document.querySelectorAll('article').length") == 3
    assert browser.evaluate("document.getElementById('lead').textContent").startswith(
        "3 clips: 0 valid, 3 invalid"
    )


def test_one_clip_is_one_clip(browser, tmp_path):
    write_report_page(tmp_path / "r.html", a_report(1))
    browser.open(tmp_path / "r.html")
    assert browser.evaluate("document.getElementById('lead').textContent").startswith("1 clip: 0 valid")


def test_a_page_over_many_clips_is_some_megabytes(tmp_path):
    report = a_report(1000)
    write_report_page(tmp_path / "r.html", report)
    assert (tmp_path / "r.html").stat().st_size < 3e6
    data = page_report(report, title="")
    assert len(data["clips"]) == MOST_DETAILED_CLIPS
    assert len(data["named"]) == 1000 - MOST_DETAILED_CLIPS
    json.dumps(data, allow_nan=False)


def test_postures_alone_have_a_page_too(browser, tmp_path):
    write_report_page(tmp_path / "r.html", ValidationReport(settings={}, postures=[]))
    browser.open(tmp_path / "r.html")
    assert browser.evaluate("document.getElementById('clips-section').hidden") is True


def test_a_timeline_draws_each_span_where_it_is(tmp_path):
    figure = plot_timelines([a_clip(count=4)])
    bars = {
        gid: patch
        for patch in figure.axes[0].patches
        if (gid := patch.get_gid()) and isinstance(patch, Rectangle)
    }
    assert {name for name in bars if name != "good"} == {
        *(f"speed/right_wrist:{5 + 10 * k}-{7 + 10 * k}" for k in range(4)),
        "collision:40-49",
    }
    for name, patch in bars.items():
        first, last = (50, 59) if name == "good" else map(int, name.rpartition(":")[2].split("-"))
        assert (patch.get_x(), patch.get_x() + patch.get_width()) == (first, last + 1)
    assert write_timelines(tmp_path / "t.svg", [a_clip() for _ in range(20)]) == 12
