"""Views of any origin: built in, or made of what a detector wrote, with its camera and the person's lengths."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.views.builtin import builtin_view as builtin_view
    from posekit.views.builtin import forget_camera as forget_camera
    from posekit.views.builtin import in_world as in_world
    from posekit.views.builtin import view_of as view_of
    from posekit.views.opened import Opened as Opened
    from posekit.views.opening import open_views as open_views
    from posekit.views.source import Source as Source
else:
    __getattr__ = on_demand(
        __name__,
        {
            "builtin": (
                "builtin_view",
                "forget_camera",
                "in_world",
                "view_of",
            ),
            "opened": ("Opened",),
            "opening": ("open_views",),
            "source": ("Source",),
        },
    )
