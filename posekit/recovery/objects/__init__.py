"""Recovery of every posture of any articulated object in an uncalibrated picture (Taylor 2000)."""

from posekit.recovery.objects.family import LinkageFamily as LinkageFamily
from posekit.recovery.objects.linkage import Linkage as Linkage
from posekit.recovery.objects.linkage import linkage_names as linkage_names
from posekit.recovery.objects.linkage import load_linkage as load_linkage
from posekit.recovery.objects.linkage import name_nearer as name_nearer
from posekit.recovery.objects.linkage import read_nearer as read_nearer
from posekit.recovery.objects.recover import ObjectRecovery as ObjectRecovery
from posekit.recovery.objects.recover import parse_scale as parse_scale
from posekit.recovery.objects.recover import recover_object as recover_object
from posekit.recovery.objects.scale import search as search
