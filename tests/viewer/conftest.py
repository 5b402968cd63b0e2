"""What the viewer's tests share: a real browser, started once, and results with their views, uncalibrated ones too."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cameras import ScaledOrthographicCamera
from posekit.errors import ViewerError
from posekit.formats.own import Family, Inferred, Result, ResultFrame, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.skeleton import JOINT, JOINTS, TREE_SEGMENTS
from posekit.synthesis import random_postures
from posekit.viewer.browser.find_browser import find_browser
from posekit.viewer.browser.studio import Studio
from posekit.viewer.scene.branch import lift_branch
from posekit.viewer.scene.drawn_subject import DrawnSubject, subject_of


@pytest.fixture(scope="session")
def studio() -> Iterator[Studio]:
    """Start the browser; without one these tests fail, they are not skipped."""
    try:
        started = Studio()
    except ViewerError as error:
        pytest.fail(f"these tests draw with a real browser: {error}", pytrace=False)
    with started:
        yield started


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Start a browser for pages; without one these tests fail, they are not skipped."""
    sync_api = pytest.importorskip("playwright.sync_api")
    try:
        program = find_browser()
    except ViewerError as error:
        pytest.fail(f"these tests look at a page with a real browser: {error}", pytrace=False)
    flags = ["--disable-gpu", "--disable-dev-shm-usage"] + (["--no-sandbox"] if os.geteuid() == 0 else [])
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=flags)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def walk() -> View:
    """Return the built-in walk towards the camera."""
    return posekit.builtin_view("seq1")


@pytest.fixture(scope="session")
def walked(walk: View) -> Result:
    """Return what was recovered from it, with every pruned branch."""
    return posekit.result_of(posekit.recover(walk, group=0.05), unit="cm", explain=True)


@pytest.fixture(scope="session")
def subject(walk: View, walked: Result) -> DrawnSubject:
    """Return its survivors, ready to be drawn."""
    return subject_of(walked, walk)


@pytest.fixture(scope="session")
def walk_files(walk: View, walked: Result, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the files of the result and the view."""
    folder = tmp_path_factory.mktemp("walk")
    posekit.write_result(folder / "walk.result.json", walked)
    posekit.write_view(folder / "walk.view.json", walk)
    return folder / "walk.result.json", folder / "walk.view.json"


# --- uncalibrated: some made by hand, with several scales, another tree, a hidden joint --------------------


SCALE, FRAMES = 400.0, 8
TAYLOR_LEVELS = (
    "right_shoulder", "left_shoulder", "right_elbow", "mid_shoulders", "left_elbow", "right_wrist", "mid_hips",
    "left_wrist", "right_hip", "left_hip", "right_knee", "left_knee", "right_ankle", "left_ankle",
)  # fmt: skip
TAYLOR_SEGMENTS = (
    ("right_shoulder", "left_shoulder"), ("mid_shoulders", "mid_hips"), ("right_hip", "left_hip"),
    *((f"{s}_{a}", f"{s}_{b}") for s in ("right", "left")
      for a, b in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))),
)  # fmt: skip


@functools.cache
def _truth() -> Array:
    """Return people in random legal postures (F, 14, 3), turned at random, the neck at depth zero."""
    rng = np.random.default_rng(11)
    figure = posekit.load_figure()
    joints = figure.forward_kinematics(random_postures(figure, FRAMES, rng))[:, : len(JOINTS)]
    turned, _ = np.linalg.qr(rng.normal(size=(FRAMES, 3, 3)))
    turned[:, :, 2] *= np.linalg.det(turned)[:, None]
    joints = (joints - joints[:, :1]) @ np.moveaxis(turned, 1, 2) + [1.5, 1.2, 0.0]
    return np.asarray(joints)


def _view(*, scale: float | None = SCALE, aspect: float = 1.0) -> View:
    """Return what an uncalibrated camera sees of them."""
    image = ScaledOrthographicCamera(scale=SCALE, aspect=aspect).project(_truth())
    model = ScaledOrthographicModel(scale=scale, aspect=aspect)
    time: Array = np.arange(FRAMES) / 10
    return View(camera=model, time=time, image=image, truth=_truth(), unit="cm")


@functools.cache
def _recovered() -> Result:
    """Return what is recovered at the true scale, with every pruned branch."""
    return posekit.result_of(posekit.recover(_view(), group=0.05), unit="cm", explain=True)


def _frame_with(frame: ResultFrame, joints: Array, scales: Array, **changes: object) -> ResultFrame:
    """Put other postures into a frame."""
    count = len(joints)
    return dataclasses.replace(
        frame,
        **{
            "joints": joints,
            "answer": None,
            "posture_set": None,
            "q": np.full((count, frame.q.shape[1]), np.nan),
            "branches": ["0" * 13] * count,
            "groups": np.zeros(count, dtype=int),
            "margins": {name: np.full(count, 0.01) for name in frame.margins},
            "fk_distance": np.zeros(count),
            "length_residual": np.zeros(count),
            "scales": scales,
            "probability": np.full(count, 1 / count),
            "refined": None,
            **changes,
        },  # type: ignore[arg-type]
    )


def _at_scales(*scales: float) -> Result:
    """Return a result whose survivors are the true posture lifted at several scales, and its mirror image."""
    result = _recovered()
    frames = []
    for frame, joints in zip(result.frames, _truth(), strict=True):
        found = []
        starts, ends = np.array(TREE_SEGMENTS).T
        deep = joints[ends, 2] - joints[starts, 2]
        lengths = np.linalg.norm(joints[ends] - joints[starts], axis=1)
        for s in scales:
            camera, image = ScaledOrthographicCamera(scale=s), SCALE * joints[:, :2]
            root = np.array([*(image[0] / s), 0.0])
            for far in (deep > 0, deep < 0):
                bits = "".join("1" if one else "0" for one in far)
                found.append(lift_branch(camera, root, image, lengths, bits, tolerance=1e-9))
        minima = np.array([*scales, 1.7 * max(scales)])
        assert frame.family is not None
        psi = np.linspace(0, 1.5, 600)
        family = dataclasses.replace(
            frame.family,
            how="closure",
            chosen=np.array(scales),
            minima_s=minima,
            minima_residual=1e-6 * np.arange(1.0, len(minima) + 1),
            curve_s=frame.family.bound / np.cos(psi),
            curve_residual=np.sin(4 * psi) ** 2,
        )
        frames.append(_frame_with(frame, np.array(found), np.repeat(scales, 2), family=family))
    return dataclasses.replace(result, frames=frames)


def _nodes(joints: Array) -> dict[str, Array]:
    """Return the joints (..., 14, 3) and the girdles' middles by name."""
    named = {name: joints[..., index, :] for name, index in JOINT.items()}
    for part, end in (("shoulders", "shoulder"), ("hips", "hip")):
        named[f"mid_{part}"] = (named[f"right_{end}"] + named[f"left_{end}"]) / 2
    return named


def _taylor() -> Result:
    """Return a result of the tree of Taylor's twelve points: neck and pelvis are completed, the pelvis on the spine."""
    result = _recovered()
    frames = []
    for frame, joints in zip(result.frames, _truth(), strict=True):
        posture = joints.copy()
        named = _nodes(posture)
        posture[JOINT["pelvis"]] = 0.8 * named["mid_hips"] + 0.2 * named["mid_shoulders"]
        posture[:, 2] -= posture[JOINT["right_shoulder"], 2]
        seen = [np.linalg.norm((named[a] - named[b])[:2]) for a, b in TAYLOR_SEGMENTS]
        lengths = [np.linalg.norm(named[a] - named[b]) for a, b in TAYLOR_SEGMENTS]
        needed = SCALE * np.array(seen) / lengths
        a, b = TAYLOR_SEGMENTS[int(np.argmax(needed))]
        family = Family(how="value", bound=float(needed.max()), segment=f"{a}-{b}", chosen=np.array([SCALE]))
        levels = {"joint": TAYLOR_LEVELS, "physical": [1] * 14, "motion": [1] * 14}
        completed = {
            name: Inferred(
                kind="completed", lower=posture[JOINT[name]], upper=posture[JOINT[name]], radius=0.0
            )
            for name in ("neck", "pelvis")
        }
        made = _frame_with(
            frame, posture[None], np.array([SCALE]), family=family, levels=levels, inferred=[completed]
        )
        frames.append(made)
    return dataclasses.replace(result, frames=frames)


def _with_hidden_elbow() -> tuple[Result, View]:
    """Return a result and a view without the right elbow: the wrist's depth is an interval then."""
    result, seen = _recovered(), _view()
    image = np.array(seen.image)
    image[:, JOINT["right_elbow"]] = np.nan
    frames = []
    for frame in result.frames:
        inferred = []
        for joints in frame.joints:
            elbow, wrist = joints[JOINT["right_elbow"]], joints[JOINT["right_wrist"]]
            nearer, deeper = np.array([0.0, 0.0, -0.2]), np.array([0.0, 0.0, 0.4])
            low, high = np.array([-0.1, -0.2, -0.3]), np.array([0.05, 0.25, 0.15])
            inferred.append(
                {
                    "right_elbow": Inferred(
                        kind="region", lower=elbow + low, upper=elbow + high, radius=0.31, fraction=0.25
                    ),
                    "right_wrist": Inferred(
                        kind="interval", lower=wrist + nearer, upper=wrist + deeper, radius=0.4
                    ),
                }
            )
        frames.append(dataclasses.replace(frame, inferred=inferred))
    return dataclasses.replace(result, frames=frames), dataclasses.replace(seen, image=image)


@pytest.fixture(scope="session")
def flat_view() -> View:
    """Return an uncalibrated view, its scale known."""
    return _view()


@pytest.fixture(scope="session")
def narrow_view() -> View:
    """Return the same with pixels that are wider than high."""
    return _view(aspect=1.25)


@pytest.fixture(scope="session")
def flat() -> Result:
    """Return what was recovered of it, with every pruned branch."""
    return _recovered()


@pytest.fixture(scope="session")
def scales() -> Result:
    """Return a result with survivors of three scales in each frame."""
    return _at_scales(400.0, 416.0, 530.0)


@pytest.fixture(scope="session")
def taylor() -> Result:
    """Return a result of Taylor's tree, neck and pelvis completed."""
    return _taylor()


@pytest.fixture(scope="session")
def hidden_elbow() -> tuple[Result, View]:
    """Return a result with an inferred elbow, and the wrist beyond it, with its view."""
    return _with_hidden_elbow()
