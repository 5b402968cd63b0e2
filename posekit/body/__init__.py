"""The figure: a URDF, its lengths and capsules, and the way between joint positions and configurations."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.body.closed_form import with_head as with_head
    from posekit.body.figure import Configurations as Configurations
    from posekit.body.figure import Figure as Figure
    from posekit.body.loading import load_figure as load_figure
    from posekit.body.stature import stature_from_lengths as stature_from_lengths
    from posekit.body.uncertainty import LengthUncertainty as LengthUncertainty
else:
    __getattr__ = on_demand(
        __name__,
        {
            "closed_form": ("with_head",),
            "figure": (
                "Configurations",
                "Figure",
            ),
            "loading": ("load_figure",),
            "stature": ("stature_from_lengths",),
            "uncertainty": ("LengthUncertainty",),
        },
    )
