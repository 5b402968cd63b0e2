"""How good recovery is where the truth is known: virtual cameras around real motion, or views with truth."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.evaluate.comparison import Comparison as Comparison
    from posekit.evaluate.comparison import compare as compare
    from posekit.evaluate.evaluation import Evaluation as Evaluation
    from posekit.evaluate.evaluation import evaluate as evaluate
    from posekit.evaluate.evaluation_report import write_evaluation as write_evaluation
    from posekit.evaluate.followed_sequences import Choice as Choice
    from posekit.evaluate.followed_sequences import Chooser as Chooser
    from posekit.evaluate.followed_sequences import by_path as by_path
    from posekit.evaluate.frame_sampling import FrameSampling as FrameSampling
    from posekit.evaluate.method import Method as Method
    from posekit.evaluate.survivor_order import Ranker as Ranker
    from posekit.evaluate.survivor_order import SurvivorOrder as SurvivorOrder
    from posekit.evaluate.survivor_order import by_probability as by_probability
    from posekit.evaluate.sweep import Sweep as Sweep
else:
    __getattr__ = on_demand(
        __name__,
        {
            "comparison": (
                "Comparison",
                "compare",
            ),
            "evaluation": (
                "Evaluation",
                "evaluate",
            ),
            "method": ("Method",),
            "survivor_order": (
                "Ranker",
                "SurvivorOrder",
                "by_probability",
            ),
            "evaluation_report": ("write_evaluation",),
            "frame_sampling": ("FrameSampling",),
            "followed_sequences": (
                "Choice",
                "Chooser",
                "by_path",
            ),
            "sweep": ("Sweep",),
        },
    )
