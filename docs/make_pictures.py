"""Make the pictures of the README and the documentation: `make pictures`."""

import sys
from pathlib import Path

from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.safe_io.writing import make_folder
from posekit.viewer import Shot, Style, subject_of, write_picture
from posekit.viewer.plots import plot_image, plot_projections, plot_tree, save
from posekit.views.builtin import builtin_view


def main(folder: Path) -> None:
    """Write the pictures into a folder."""
    make_folder(folder)
    view = builtin_view("seq2")
    result = result_of(recover(view, group=0.05), unit="cm", explain=True)
    subject = subject_of(result, view)
    frame = result.frames[0]
    assert frame.groups is not None
    groups = frame.groups.tolist()
    firsts = [groups.index(group) for group in sorted(set(groups))]
    shown = subject.frames[0]
    write_picture(folder / "survivors.png", subject, [shown.chosen(firsts)], shot=Shot(size=(1000, 560)))
    write_picture(
        folder / "superposed.png",
        subject,
        [shown],
        style=Style(layout="superposed"),
        shot=Shot(size=(1000, 640), azimuth=60.0),
    )
    save(plot_image(view), folder / "image.png")
    save(plot_projections(frame.joints[firsts]), folder / "projections.png")
    save(plot_tree(frame), folder / "tree.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
