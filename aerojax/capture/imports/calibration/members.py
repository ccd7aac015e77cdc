"""The members behind the door of calibration formats, by name."""

from aerojax.capture.imports.calibration.auto import AutoCalibrationConfig
from aerojax.capture.imports.calibration.base import CalibrationConfig
from aerojax.capture.imports.calibration.colmap import ColmapConfig
from aerojax.capture.imports.calibration.drone_tracking import DroneTrackingConfig
from aerojax.capture.imports.calibration.kalibr import KalibrConfig
from aerojax.capture.imports.calibration.nerfstudio import NerfstudioConfig
from aerojax.capture.imports.calibration.opencv import OpencvConfig
from aerojax.capture.imports.calibration.projections import ProjectionsConfig
from aerojax.capture.imports.calibration.ros import RosConfig

MEMBERS: dict[str, type[CalibrationConfig]] = {
    "auto": AutoCalibrationConfig,
    "colmap": ColmapConfig,
    "nerfstudio": NerfstudioConfig,
    "opencv": OpencvConfig,
    "kalibr": KalibrConfig,
    "projections": ProjectionsConfig,
    "drone_tracking": DroneTrackingConfig,
    "ros": RosConfig,
}
