"""Postures drawn over the photographs, or the video, that they came from: projected and painted, without a browser."""

from posekit.viewer.overlay.drawn_photograph import check_photographs as check_photographs
from posekit.viewer.overlay.drawn_photograph import write_photographs as write_photographs
from posekit.viewer.overlay.figure_painter import DrawnPerson as DrawnPerson
from posekit.viewer.overlay.figure_painter import paint as paint
from posekit.viewer.overlay.frame_pictures import ImageFiles as ImageFiles
from posekit.viewer.overlay.frame_pictures import frame_pictures as frame_pictures
from posekit.viewer.overlay.overlaid_person import OverlaidPerson as OverlaidPerson
from posekit.viewer.overlay.overlaid_person import overlaid_person as overlaid_person
from posekit.viewer.overlay.overlay import Overlay as Overlay
from posekit.viewer.overlay.overlay import check_overlay as check_overlay
from posekit.viewer.overlay.overlay import write_overlay as write_overlay
