"""Any articulated object from an uncalibrated picture (Taylor 2000): every posture, with its configuration."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand
from posekit.settings.scale import Scale as Scale
from posekit.settings.scale import parse_scale as parse_scale

if TYPE_CHECKING:
    from posekit.objects.articulated import ArticulatedObject as ArticulatedObject
    from posekit.objects.articulated import load_object as load_object
    from posekit.objects.articulated import tolerance_of as tolerance_of
    from posekit.objects.drawn_views import draw_view as draw_view
    from posekit.objects.object_recovery import recover_object as recover_object
    from posekit.objects.object_summary import object_lines as object_lines
    from posekit.objects.object_tolerance import ObjectTolerance as ObjectTolerance
else:
    __getattr__ = on_demand(
        __name__,
        {
            "articulated": (
                "ArticulatedObject",
                "load_object",
                "tolerance_of",
            ),
            "drawn_views": ("draw_view",),
            "object_recovery": ("recover_object",),
            "object_summary": ("object_lines",),
            "object_tolerance": ("ObjectTolerance",),
        },
    )
