"""Force, shape, strain and Young's modulus from the frames of an optical tactile sensor.

Three lines to a modulus::

    import tactile_imaging
    scene = tactile_imaging.simulate()
    print(tactile_imaging.press_of(scene).modulus())
"""

from ._native import (
    Contact,
    Estimate,
    Match,
    Modulus,
    Object,
    Pipeline,
    Press,
    Session,
    SimulatedPress,
    Strain,
    StrainBetween,
    Surface,
    TactileError,
    ThinPlateSpline,
    __version__,
    integrate,
    match_points,
    simulate,
    strain_between,
)


def press_of(scene, **stages):
    """The press of a simulated scene, on the default pipeline of its sensor.

    Parameters
    ----------
    scene : SimulatedPress
    **stages : keyword arguments of `Pipeline` that replace defaults, as `matcher=`
    """
    arguments = {
        "pairs": scene.pairs,
        "pixel_size": scene.pixel_size,
        "object": Object.sphere(scene.radius),
        "waveguide": scene.waveguide,
        "estimator": "sphere",
    }
    press = Pipeline(**(arguments | stages)).press(scene.reference)
    for frame in scene.frames:
        press.add_frame(frame)
    return press


__all__ = [
    "Contact",
    "Estimate",
    "Match",
    "Modulus",
    "Object",
    "Pipeline",
    "Press",
    "Session",
    "SimulatedPress",
    "Strain",
    "StrainBetween",
    "Surface",
    "TactileError",
    "ThinPlateSpline",
    "__version__",
    "integrate",
    "match_points",
    "press_of",
    "simulate",
    "strain_between",
]
