"""Evaluation of recoveries whose true postures are known: of one result, or of many views with noise."""

from posekit.evaluation.evaluate import Evaluation as Evaluation
from posekit.evaluation.evaluate import evaluate as evaluate
from posekit.evaluation.evaluate import true_branch as true_branch
from posekit.evaluation.scores import MEASURES as MEASURES
from posekit.evaluation.scores import correct_poses_score as correct_poses_score
from posekit.evaluation.scores import posture_errors as posture_errors
from posekit.evaluation.scores import reliability as reliability
from posekit.evaluation.sweep import evaluate_method as evaluate_method
from posekit.evaluation.truth import truth_of as truth_of
from posekit.evaluation.truth import with_truth as with_truth
