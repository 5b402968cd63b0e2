"""Any articulated object from an uncalibrated picture (Taylor 2000): every posture, with its configuration."""

from posekit.pipeline.objects.articulated import ArticulatedObject as ArticulatedObject
from posekit.pipeline.objects.articulated import load_object as load_object
from posekit.pipeline.objects.articulated import tolerance_of as tolerance_of
from posekit.pipeline.objects.draw import draw_view as draw_view
from posekit.pipeline.objects.recover import recover_object as recover_object
from posekit.pipeline.objects.summary import object_lines as object_lines
from posekit.pipeline.objects.tolerance import ObjectTolerance as ObjectTolerance
