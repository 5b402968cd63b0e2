"""Files: the boundary where what others wrote is checked, once, before anything is calculated from it."""

from typing import TYPE_CHECKING

from posekit.on_demand import on_demand

if TYPE_CHECKING:
    from posekit.formats.own.camera_model import CameraModel as CameraModel
    from posekit.formats.own.camera_model import LeeChenModel as LeeChenModel
    from posekit.formats.own.camera_model import OpenCVModel as OpenCVModel
    from posekit.formats.own.camera_model import ScaledOrthographicModel as ScaledOrthographicModel
    from posekit.formats.own.family import Family as Family
    from posekit.formats.own.inferred import Inferred as Inferred
    from posekit.formats.own.nearer import read_nearer as read_nearer
    from posekit.formats.own.object_result import ObjectFrame as ObjectFrame
    from posekit.formats.own.object_result import ObjectResult as ObjectResult
    from posekit.formats.own.object_result import check_object_path as check_object_path
    from posekit.formats.own.object_result import read_object as read_object
    from posekit.formats.own.object_result import write_object as write_object
    from posekit.formats.own.object_view import ObjectView as ObjectView
    from posekit.formats.own.object_view import read_object_view as read_object_view
    from posekit.formats.own.object_view import write_object_view as write_object_view
    from posekit.formats.own.posture_set import PostureSet as PostureSet
    from posekit.formats.own.postures import Postures as Postures
    from posekit.formats.own.postures import read_postures as read_postures
    from posekit.formats.own.postures import write_postures as write_postures
    from posekit.formats.own.postures_q import NamedConfigurations as NamedConfigurations
    from posekit.formats.own.postures_q import read_configurations as read_configurations
    from posekit.formats.own.postures_q import write_configurations as write_configurations
    from posekit.formats.own.report import Finding as Finding
    from posekit.formats.own.report import PostureReport as PostureReport
    from posekit.formats.own.report import ValidationReport as ValidationReport
    from posekit.formats.own.report_file import check_report_path as check_report_path
    from posekit.formats.own.report_file import read_report as read_report
    from posekit.formats.own.report_file import write_report as write_report
    from posekit.formats.own.report_making import JudgedCheck as JudgedCheck
    from posekit.formats.own.report_making import make_report as make_report
    from posekit.formats.own.result import Result as Result
    from posekit.formats.own.result import ResultFrame as ResultFrame
    from posekit.formats.own.result_file import check_result_path as check_result_path
    from posekit.formats.own.result_file import read_result as read_result
    from posekit.formats.own.result_file import write_result as write_result
    from posekit.formats.own.root import Root as Root
    from posekit.formats.own.schemas import SCHEMA_NAMES as SCHEMA_NAMES
    from posekit.formats.own.schemas import schema as schema
    from posekit.formats.own.schemas import schema_text as schema_text
    from posekit.formats.own.units import PER_METRE as PER_METRE
    from posekit.formats.own.units import Unit as Unit
    from posekit.formats.own.units import parse_length as parse_length
    from posekit.formats.own.view import View as View
    from posekit.formats.own.view_file import read_view as read_view
    from posekit.formats.own.view_file import write_view as write_view
else:
    __getattr__ = on_demand(
        __name__,
        {
            "camera_model": (
                "CameraModel",
                "LeeChenModel",
                "OpenCVModel",
                "ScaledOrthographicModel",
            ),
            "family": ("Family",),
            "inferred": ("Inferred",),
            "nearer": ("read_nearer",),
            "object_result": (
                "ObjectFrame",
                "ObjectResult",
                "check_object_path",
                "read_object",
                "write_object",
            ),
            "object_view": (
                "ObjectView",
                "read_object_view",
                "write_object_view",
            ),
            "posture_set": ("PostureSet",),
            "postures": (
                "Postures",
                "read_postures",
                "write_postures",
            ),
            "postures_q": (
                "NamedConfigurations",
                "read_configurations",
                "write_configurations",
            ),
            "report": ("Finding", "PostureReport", "ValidationReport"),
            "report_file": ("check_report_path", "read_report", "write_report"),
            "report_making": ("JudgedCheck", "make_report"),
            "result": (
                "Result",
                "ResultFrame",
            ),
            "result_file": (
                "check_result_path",
                "read_result",
                "write_result",
            ),
            "root": ("Root",),
            "schemas": (
                "SCHEMA_NAMES",
                "schema",
                "schema_text",
            ),
            "units": (
                "PER_METRE",
                "Unit",
                "parse_length",
            ),
            "view": ("View",),
            "view_file": (
                "read_view",
                "write_view",
            ),
        },
    )
