"""What the viewer's tests share: a real browser, started once, and a result with its view."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import posekit
from posekit.errors import ViewerError
from posekit.files import Result, View
from posekit.viewer.browser.studio import Studio
from posekit.viewer.scene.subject import Subject, subject_of


@pytest.fixture(scope="session")
def studio() -> Iterator[Studio]:
    """Start the browser; without one these tests fail, they are not skipped."""
    try:
        started = Studio()
    except ViewerError as error:
        pytest.fail(f"these tests draw with a real browser: {error}", pytrace=False)
    with started:
        yield started


@pytest.fixture(scope="session")
def walk() -> View:
    """Return the built-in walk towards the camera."""
    return posekit.builtin_view("seq1")


@pytest.fixture(scope="session")
def walked(walk: View) -> Result:
    """Return what was recovered from it, with every pruned branch."""
    return posekit.result_of(posekit.recover(walk, group=0.05), unit="cm", explain=True)


@pytest.fixture(scope="session")
def subject(walk: View, walked: Result) -> Subject:
    """Return its survivors, ready to be drawn."""
    return subject_of(walked, walk)


@pytest.fixture(scope="session")
def walk_files(walk: View, walked: Result, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return the files of the result and the view."""
    folder = tmp_path_factory.mktemp("walk")
    posekit.write_result(folder / "walk.result.json", walked)
    posekit.write_view(folder / "walk.view.json", walk)
    return folder / "walk.result.json", folder / "walk.view.json"
