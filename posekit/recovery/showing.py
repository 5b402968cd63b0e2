"""Pages of what was recovered, shown where somebody is."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posekit.errors import InputError
from posekit.formats.motion.motion_axes import up_rotation
from posekit.formats.own import Postures, View
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.result import result_of
from posekit.viewer.page.page import page_html
from posekit.viewer.showing import ShownPage, show_page


def show_recovery(recovery: Recovery, view: View | None, path: str | Path | None) -> ShownPage:
    """Show the page of all survivors of all frames.

    Parameters
    ----------
    recovery : Recovery
        What is shown.
    view : View, optional
        What was recovered: the page then shows the image, too.
    path : path, optional
        Where the page is written.
    """
    return show_page(page_html(result_of(recovery), view, title="recovery"), path)


def show_frame(frame: FrameRecovery, path: str | Path | None) -> ShownPage:
    """Show the page of a frame's survivors, the likeliest first, on the ground.

    Parameters
    ----------
    frame : FrameRecovery
        What is shown.
    path : path, optional
        Where the page is written.

    Raises
    ------
    InputError
        Where it has no posture.
    """
    if not len(frame):
        why = frame.reason or "every posture was rejected"
        raise InputError(
            f"frame {frame.number}: no posture to show: {why}; expected survivors; choose another frame"
        )
    placed = frame.likeliest_first @ up_rotation("-y", "+z").T  # of a camera that is held level
    ground = np.array([0.0, 0.0, np.nanmin(placed[..., 2])])
    return show_page(page_html(Postures(joints=placed - ground), title=f"frame {frame.number}"), path)
