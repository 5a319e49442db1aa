"""How the follower sounds: radiation, microphone, calibration."""

from cam_rig.acoustics.calibrate import Calibration, calibrate
from cam_rig.acoustics.level import level_db, pressure_pa
from cam_rig.acoustics.microphone import MicrophoneState, hear
from cam_rig.acoustics.radiation import RadiationParameters
from cam_rig.acoustics.steady import steady_power

__all__ = [
    "Calibration",
    "MicrophoneState",
    "RadiationParameters",
    "calibrate",
    "hear",
    "level_db",
    "pressure_pa",
    "steady_power",
]
