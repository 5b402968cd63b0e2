"""What the two papers print, reproduced."""

from posekit.papers.all_papers import reproduce_all as reproduce_all
from posekit.papers.demo_results import demo as demo
from posekit.papers.lee_chen import reproduce_lee_chen as reproduce_lee_chen
from posekit.papers.taylor import reproduce_taylor as reproduce_taylor
