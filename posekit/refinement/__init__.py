"""Noise: the most likely posture for each survivor, how sure it is, and what noise cannot explain.

`ObservedFrames` says what was seen and how well; `find_trunks` finds the torsos and hips that the noise allows, from
which the tree is grown; `tolerance_of` and `under_noise` say what the tree must allow for; `refine` turns its leaves
into the most likely postures, with a chi-square test (`Refined.explained`) and a covariance for every joint; `merge`
makes one of those that became one. How well lengths are known `posekit.body.LengthUncertainty` says; `diagnose` names
lengths that are wrong. See docs, "Noise".
"""

from posekit.refinement.allowance import NoisyRange as NoisyRange
from posekit.refinement.allowance import under_noise as under_noise
from posekit.refinement.diagnosis import LengthDoubt as LengthDoubt
from posekit.refinement.diagnosis import diagnose as diagnose
from posekit.refinement.merging import Merged as Merged
from posekit.refinement.merging import merge as merge
from posekit.refinement.observed_frames import ObservedFrames as ObservedFrames
from posekit.refinement.optics import project as project
from posekit.refinement.prior import RootPrior as RootPrior
from posekit.refinement.refine import refine as refine
from posekit.refinement.refined import REJECTION_PROBABILITY as REJECTION_PROBABILITY
from posekit.refinement.refined import Refined as Refined
from posekit.refinement.survival import chi2_survival as chi2_survival
from posekit.refinement.tolerance import NoiseTolerance as NoiseTolerance
from posekit.refinement.tolerance import tolerance_of as tolerance_of
from posekit.refinement.trunks import Trunks as Trunks
from posekit.refinement.trunks import find_trunks as find_trunks
