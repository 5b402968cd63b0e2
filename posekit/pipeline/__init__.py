"""Whole jobs: a view to certified postures, postures to verdicts, the papers' tables."""

from posekit.pipeline.demo import demo as demo
from posekit.pipeline.following import Following as Following
from posekit.pipeline.following import follow as follow
from posekit.pipeline.following import follow_frames as follow_frames
from posekit.pipeline.following import survivor_frames as survivor_frames
from posekit.pipeline.recover import recover as recover
from posekit.pipeline.recovery import FrameRecovery as FrameRecovery
from posekit.pipeline.recovery import Recovery as Recovery
from posekit.pipeline.reproduce import reproduce_lee_chen as reproduce_lee_chen
from posekit.pipeline.result import result_of as result_of
from posekit.pipeline.rooting import Rooting as Rooting
from posekit.pipeline.scale import Scale as Scale
from posekit.pipeline.scale import parse_scale as parse_scale
from posekit.pipeline.summary import summary_lines as summary_lines
from posekit.pipeline.taylor.reproduce import reproduce_taylor as reproduce_taylor
from posekit.pipeline.tolerance import EXACT as EXACT
from posekit.pipeline.tolerance import MEASURED as MEASURED
from posekit.pipeline.tolerance import PHOTOGRAPH as PHOTOGRAPH
from posekit.pipeline.tolerance import Tolerance as Tolerance
from posekit.pipeline.validate import recovered_with as recovered_with
from posekit.pipeline.validate import validate as validate
from posekit.pipeline.views import builtin_view as builtin_view
from posekit.pipeline.views import forget_camera as forget_camera
from posekit.pipeline.views import view_of as view_of
