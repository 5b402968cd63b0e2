"""Make the pictures of the README and the documentation: `make pictures`."""

import sys
import tempfile
from pathlib import Path

import numpy as np

import posekit
from posekit.formats.held_postures import HeldPostures
from posekit.formats.own import Postures
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.safe_io.writing import make_folder
from posekit.samples import write_samples
from posekit.skeleton import JOINT
from posekit.synthesis import CameraSphere, random_views
from posekit.viewer import Shot, Style, subject_of, write_picture
from posekit.viewer.overlay import Overlay, frame_pictures, overlaid_person, write_overlay, write_photographs
from posekit.viewer.plots import plot_image, plot_projections, plot_tree, save
from posekit.viewer.plots.angle_plot import plot_angles
from posekit.viewer.plots.timeline_plot import write_timelines
from posekit.views.builtin import builtin_view, view_of
from posekit.views.given_views import given_views


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
    write_over(folder / "over.png")
    write_angles(folder / "angles.png")
    write_timelines(folder / "timelines.svg", posekit.validate(damaged_walk()).clips or ())


def write_over(path: Path) -> None:
    """Draw a posture that nobody had as a photograph, and over it what is recovered from its points."""
    scene = random_views(
        posekit.load_figure(), 1, np.random.default_rng(6), CameraSphere(distance=(2.5, 2.5))
    )
    view = view_of(scene)
    with tempfile.TemporaryDirectory() as drawn:
        write_photographs(Path(drawn), view)
        person = overlaid_person(result_of(recover(view)), view)
        write_overlay(path, [person], frame_pictures(Path(drawn)), Overlay(size=(1000, 600)))


def write_angles(path: Path) -> None:
    """Plot knees and elbows of the samples' walker, followed through his pictures, beside the truth."""
    with tempfile.TemporaryDirectory() as samples:
        write_samples(samples)
        source = posekit.Source(camera=f"{samples}/calibration.toml:cam_01", stature=1.75, rate=10.0)
        opened = given_views(Path(samples) / "keypoints", source, Path(samples) / "walk.npz")
        view = opened[0].view
    recovery = recover(view)
    result = result_of(recovery, following=posekit.follow(recovery, k=1))
    save(plot_angles(result, view, angles="elbow,knee"), path)


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
