"""Probabilities of survivors, computed from the image, a prior of postures, gravity, balance and ground contact."""

from posekit.ranking.prior import Prior as Prior
from posekit.ranking.prior import load_prior as load_prior
from posekit.ranking.rank import Up as Up
from posekit.ranking.rank import deviation_of_tolerance as deviation_of_tolerance
from posekit.ranking.rank import log_terms as log_terms
from posekit.ranking.rank import softmax as softmax
from posekit.ranking.representatives import WITHIN_METRES as WITHIN_METRES
from posekit.ranking.representatives import representatives as representatives
from posekit.ranking.standing import centre_of_mass as centre_of_mass
