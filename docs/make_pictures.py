"""Make the pictures of the README and the documentation: `make pictures`."""

import sys
from pathlib import Path

import numpy as np

import posekit
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.safe_io.writing import make_folder
from posekit.skeleton import JOINT
from posekit.viewer import Shot, Style, subject_of, write_picture
from posekit.viewer.plots import plot_image, plot_projections, plot_tree, save
from posekit.viewer.plots.timeline_plot import write_timelines
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
    write_timelines(folder / "timelines.svg", posekit.validate(damaged_walk()).clips or ())


def damaged_walk() -> HeldPostures:
    """Return two clips of somebody who sways: in one he jumps, bends an elbow backward and loses a wrist."""
    time = np.arange(120) / 30
    standing = posekit.load_figure().neutral_points[:14]
    sway = (0.01 * np.sin(time) + 0.001 * time**2)[:, None, None] * np.array([1.0, 0.3, 0.0])
    joints = np.repeat((standing + sway)[None], 2, axis=0)
    joints[0, 40:42, :, 1] += 0.8
    joints[0, 70:85, JOINT["right_wrist"]] += [-0.2, 0.0, 0.1]
    joints[0, 100:110, JOINT["left_wrist"]] = np.nan
    return HeldPostures(
        postures=Postures(joints=joints.reshape(-1, 14, 3)),
        frame=np.arange(240),
        clip=np.repeat([0, 1], 120),
        time=np.tile(time, 2),
        up="+z",
        clips=("damaged", "whole"),
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
