"""Views of any origin: built in, or made of what a detector wrote, with its camera and the person's lengths."""

from posekit.views.builtin import builtin_view as builtin_view
from posekit.views.builtin import forget_camera as forget_camera
from posekit.views.builtin import view_of as view_of
from posekit.views.given_views import given_views as given_views
from posekit.views.opening import Opened as Opened
from posekit.views.opening import open_views as open_views
from posekit.views.source import Source as Source
