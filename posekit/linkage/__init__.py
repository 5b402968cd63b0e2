"""Any articulated object from a single uncalibrated picture (Taylor 2000): linkages, and their family of postures."""

from posekit.linkage.family import Family as Family
from posekit.linkage.family import name_nearer as name_nearer
from posekit.linkage.family import read_nearer as read_nearer
from posekit.linkage.linkage import Linkage as Linkage
from posekit.linkage.linkage import Midpoint as Midpoint
from posekit.linkage.minima import Minima as Minima
from posekit.linkage.reading import linkage_names as linkage_names
from posekit.linkage.reading import load_linkage as load_linkage
from posekit.linkage.reading import parse_linkage as parse_linkage
from posekit.linkage.search import search as search
from posekit.linkage.spanning import SpanningTree as SpanningTree
from posekit.linkage.spanning import span as span
