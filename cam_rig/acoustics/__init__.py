"""How the follower sounds: radiation, pressure samples, sound-level meter."""

from cam_rig.acoustics.bands import Spectrum, third_octaves
from cam_rig.acoustics.level import level_db, pressure_pa
from cam_rig.acoustics.pressure_rms import MicrophoneState, rms_pressure
from cam_rig.acoustics.pressure_samples import SoundSource
from cam_rig.acoustics.radiation import RadiationParameters
from cam_rig.acoustics.sound_level_meter import Reading, SoundLevelMeter
from cam_rig.acoustics.steady import steady_power

__all__ = [
    "MicrophoneState",
    "RadiationParameters",
    "Reading",
    "SoundLevelMeter",
    "SoundSource",
    "Spectrum",
    "level_db",
    "pressure_pa",
    "rms_pressure",
    "steady_power",
    "third_octaves",
]
