"""Any articulated object from an uncalibrated picture (Taylor 2000): every posture, with its configuration."""

from posekit.objects.articulated import ArticulatedObject as ArticulatedObject
from posekit.objects.articulated import load_object as load_object
from posekit.objects.articulated import tolerance_of as tolerance_of
from posekit.objects.draw import draw_view as draw_view
from posekit.objects.recover import recover_object as recover_object
from posekit.objects.summary import object_lines as object_lines
from posekit.objects.tolerance import ObjectTolerance as ObjectTolerance
from posekit.settings.scale import Scale as Scale
from posekit.settings.scale import parse_scale as parse_scale
