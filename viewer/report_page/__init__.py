"""The page of a report: which checks reject what, the worst clips with their timelines, and the frames behind them."""

from posekit.viewer.report_page.report_page import write_report_page as write_report_page
