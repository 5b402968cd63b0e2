"""Which survivor, and how sure: a probability for each, from the image, a prior on postures, gravity and the ground.

`rank` orders the survivors of many frames at once by their `RankingEvidence`; `load_prior` reads the table for it.
"""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand
from posekit.ranking.centre_of_mass import centre_of_mass as centre_of_mass
from posekit.ranking.rank import rank as rank

if TYPE_CHECKING:
    from posekit.ranking.depth import Depth as Depth
    from posekit.ranking.deviation import deviation_of_noise as deviation_of_noise
    from posekit.ranking.deviation import deviation_of_tolerance as deviation_of_tolerance
    from posekit.ranking.evidence import RankingEvidence as RankingEvidence
    from posekit.ranking.posture_prior import TERM_NAMES as TERM_NAMES
    from posekit.ranking.posture_prior import Prior as Prior
    from posekit.ranking.prior_file import load_prior as load_prior
    from posekit.ranking.prior_file import write_prior as write_prior
    from posekit.ranking.rank import Term as Term
    from posekit.ranking.ranking import Ranking as Ranking
    from posekit.ranking.upright import Up as Up
else:
    __getattr__ = on_demand(
        __name__,
        {
            "depth": ("Depth",),
            "deviation": (
                "deviation_of_noise",
                "deviation_of_tolerance",
            ),
            "evidence": ("RankingEvidence",),
            "posture_prior": (
                "TERM_NAMES",
                "Prior",
            ),
            "prior_file": (
                "load_prior",
                "write_prior",
            ),
            "rank": ("Term",),
            "ranking": ("Ranking",),
            "upright": ("Up",),
        },
    )
