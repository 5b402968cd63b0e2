"""The figure: a URDF, its lengths and capsules, and the way between joint positions and configurations."""

from posekit.figure.closed_form import with_head as with_head
from posekit.figure.figure import Configurations as Configurations
from posekit.figure.figure import Figure as Figure
from posekit.figure.loading import load_figure as load_figure
from posekit.figure.stature import stature_from_lengths as stature_from_lengths
