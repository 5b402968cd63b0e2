"""How good recovery is where the truth is known: virtual cameras around real motion, or views with truth."""

from posekit.pipeline.evaluation.evaluate import Evaluation as Evaluation
from posekit.pipeline.evaluation.evaluate import evaluate as evaluate
from posekit.pipeline.evaluation.method import Method as Method
from posekit.pipeline.evaluation.ranking import Ranker as Ranker
from posekit.pipeline.evaluation.ranking import Ranking as Ranking
from posekit.pipeline.evaluation.ranking import by_probability as by_probability
from posekit.pipeline.evaluation.report import write_evaluation as write_evaluation
from posekit.pipeline.evaluation.sampling import Sampling as Sampling
from posekit.pipeline.evaluation.sequences import Choice as Choice
from posekit.pipeline.evaluation.sequences import Chooser as Chooser
from posekit.pipeline.evaluation.sequences import by_path as by_path
from posekit.pipeline.evaluation.sweep import Sweep as Sweep
