"""The paper's figures as matplotlib plots."""

from posekit.viewer.plots.curve import plot_curve as plot_curve
from posekit.viewer.plots.image_plot import plot_image as plot_image
from posekit.viewer.plots.levels import plot_levels as plot_levels
from posekit.viewer.plots.noise_bound import plot_noise_bound as plot_noise_bound
from posekit.viewer.plots.plot_file import save as save
from posekit.viewer.plots.projections import plot_projections as plot_projections
from posekit.viewer.plots.tree_plot import plot_tree as plot_tree
