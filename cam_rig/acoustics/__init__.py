"""Sound of a rig: sound pressure from the contact force, and a sound-level meter."""

from cam_rig.acoustics.pressure import (
    MicrophoneState,
    RadiationParameters,
    SoundSource,
    level_db,
    pressure_pa,
    rms_pressure,
    steady_power,
)
from cam_rig.acoustics.sound_level_meter import Reading, SoundLevelMeter, Spectrum, third_octaves

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
