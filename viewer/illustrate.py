"""Pictures beside results: the paper's figures, a page to turn by hand, and a scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from posekit.errors import ViewerError
from posekit.formats.own import Result, ResultFrame, View

MAX_GROUPS = 64
"""Groups of the first frame that are drawn one by one; where it has none, each survivor is one."""

SCENE_GROUPS = 8
"""Groups of the first frame whose representatives stand side by side in the scene."""


def illustrate(
    folder: Path,
    name: str,
    result: Result,
    view: View,
    *,
    printed: Mapping[str, Sequence[Sequence[int]]] | None = None,
    printed_frames: Sequence[int] = (),
) -> Iterator[str]:
    """Draw a result in every way; what cannot be drawn here is said and left out.

    Parameters
    ----------
    folder : Path
        Where ``NAME.page.html``, ``NAME.image.png``, ``NAME.levels.png``, ``NAME.projections.png`` (one
        survivor of each group), ``NAME.superposed.png`` (these in one drawing), ``NAME.tree.png``
        and ``NAME.scene.png`` are written.
    result : Result
        Explained, for the tree.
    view : View
        What it was recovered from.
    printed : mapping, optional
        Printed survivors per level, to stand beside those of `printed_frames` (from 0).

    Yields
    ------
    str
        For each kind of picture that could not be drawn, why.
    """
    if not any(len(frame.joints) for frame in result.frames):
        yield f"{name}: no posture survives: no pictures"
        return
    drawings: tuple[Callable[[], None], ...] = (
        lambda: _page(folder, name, result, view),
        lambda: _plots(folder, name, result, view, printed, printed_frames),
        lambda: _scene(folder, name, result, view),
    )
    for draw in drawings:
        try:
            draw()
        except ViewerError as error:
            yield f"{name}: left out: {error}"


def _page(folder: Path, name: str, result: Result, view: View) -> None:
    from posekit.viewer.page import write_page

    write_page(folder / f"{name}.page.html", result, view, title=name)


def _plots(
    folder: Path,
    name: str,
    result: Result,
    view: View,
    printed: Mapping[str, Sequence[Sequence[int]]] | None,
    printed_frames: Sequence[int],
) -> None:
    from posekit.viewer.plots import plot_image, plot_levels, plot_projections, plot_tree, save
    from posekit.viewer.plots.projections import letter

    few = range(min(len(result.frames), 5))
    chosen = [result.frames[k] for k in (printed_frames or few)]
    first = next(frame for frame in result.frames if len(frame.joints))
    save(plot_image(view, list(few), result=result), folder / f"{name}.image.png")
    save(plot_levels(chosen, printed=printed), folder / f"{name}.levels.png")
    count = _group_sizes(first)
    joints = first.joints[list(count)[:MAX_GROUPS]]
    alone = len(count) == len(first.joints)
    titles = None if alone else [f"{letter(k)} 1 of {size}" for k, size in enumerate(count.values())]
    save(plot_projections(joints, titles=titles and titles[:MAX_GROUPS]), folder / f"{name}.projections.png")
    save(plot_projections(joints, superposed=True), folder / f"{name}.superposed.png")
    if first.pruned is not None:
        save(plot_tree(first), folder / f"{name}.tree.png")


def _scene(folder: Path, name: str, result: Result, view: View) -> None:
    from posekit.viewer import subject_of, write_picture

    subject = subject_of(result, view)
    k = next(k for k, frame in enumerate(result.frames) if len(frame.joints))
    chosen = subject.frames[k].chosen(list(_group_sizes(result.frames[k]))[:SCENE_GROUPS])
    write_picture(folder / f"{name}.scene.png", subject, [chosen], title=name)


def _group_sizes(frame: ResultFrame) -> dict[int, int]:
    """Return the first survivor of each group, and how many are in it."""
    members = list(range(len(frame.joints))) if frame.groups is None else frame.groups.tolist()
    return {members.index(group): size for group, size in Counter(members).items()}
