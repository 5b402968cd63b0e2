"""The figure: a URDF, its lengths and capsules, and closed-form conversion of joint positions to configurations."""

from posekit.body.angles import ClosedForm as ClosedForm
from posekit.body.angles import Limits as Limits
from posekit.body.figure import Configurations as Configurations
from posekit.body.figure import Figure as Figure
from posekit.body.figure import load_figure as load_figure
from posekit.body.figure import with_head as with_head
from posekit.body.lengths import lay as lay
from posekit.body.lengths import segment_lengths as segment_lengths
from posekit.body.lengths import shoulders_are_behind as shoulders_are_behind
from posekit.body.lengths import stature_from_lengths as stature_from_lengths
from posekit.body.measured import scaled_to as scaled_to
from posekit.body.uncertainty import MEASURED_LENGTHS as MEASURED_LENGTHS
from posekit.body.uncertainty import UNKNOWN_ADULT as UNKNOWN_ADULT
from posekit.body.uncertainty import LengthUncertainty as LengthUncertainty
