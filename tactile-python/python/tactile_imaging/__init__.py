"""Force, shape, strain and Young's modulus from the frames of an optical tactile sensor.

Three lines to a modulus::

    import tactile_imaging as ti
    scene = ti.simulate()
    print(ti.press_of(scene).modulus())

Units are SI. Images are arrays [row, column], frames of uint8. x is the column, y the row, z points
to the object. (0, 0) is the centre of the first pixel.
"""

from ._native import (
    CheckPress,
    Contact,
    Estimate,
    GelContact,
    GelFrame,
    GelReport,
    GelSensor,
    HertzContact,
    Inclusion,
    Lump,
    Load,
    Markers,
    Match,
    Modulus,
    Object,
    Pipeline,
    Press,
    Sensor,
    Session,
    SimulatedPress,
    Strain,
    StrainBetween,
    Surface,
    TactileError,
    ThinPlateSpline,
    __version__,
    depth,
    estimate_modulus,
    hertz,
    inclusion,
    inclusion_of_scene,
    integrate,
    markers,
    match_points,
    reconstruct,
    simulate,
    strain_between,
)
from ._simulated import pipeline_of, press_of

__all__ = [
    "CheckPress",
    "Contact",
    "Estimate",
    "GelContact",
    "GelFrame",
    "GelReport",
    "GelSensor",
    "HertzContact",
    "Inclusion",
    "Lump",
    "Load",
    "Markers",
    "Match",
    "Modulus",
    "Object",
    "Pipeline",
    "Press",
    "Sensor",
    "Session",
    "SimulatedPress",
    "Strain",
    "StrainBetween",
    "Surface",
    "TactileError",
    "ThinPlateSpline",
    "__version__",
    "depth",
    "estimate_modulus",
    "hertz",
    "inclusion",
    "inclusion_of_scene",
    "integrate",
    "markers",
    "match_points",
    "pipeline_of",
    "press_of",
    "reconstruct",
    "simulate",
    "strain_between",
]
