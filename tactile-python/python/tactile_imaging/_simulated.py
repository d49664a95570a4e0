"""Pipelines and presses of simulated scenes."""

from typing import Any

from ._native import Object, Pipeline, Press, SimulatedPress


def pipeline_of(scene: SimulatedPress, **stages: Any) -> Pipeline:
    """The default pipeline of a simulated sensor and its ball.

    Simulated light follows the pressure whatever presses, so that `coupling_error` is 0.

    Parameters
    ----------
    scene : SimulatedPress
    **stages
        Keyword arguments of `Pipeline` that replace defaults, as `matcher=`.

    Returns
    -------
    Pipeline
    """
    arguments: dict[str, Any] = {
        "object": Object.sphere(scene.radius, poisson_ratio=scene.poisson_ratio),
        "pairs": scene.pairs,
        "pixel_size": scene.pixel_size,
        "waveguide": scene.waveguide,
        "estimator": scene.estimator,
        "coupling_error": 0.0,
    }
    return Pipeline(**(arguments | stages))


def press_of(scene: SimulatedPress, **stages: Any) -> Press:
    """The press of a simulated scene, on the default pipeline of its sensor.

    Parameters
    ----------
    scene : SimulatedPress
    **stages
        Keyword arguments of `Pipeline` that replace defaults, as `matcher=`.

    Returns
    -------
    Press
    """
    press = pipeline_of(scene, **stages).press(scene.reference)
    for frame in scene.frames:
        press.add_frame(frame)
    return press
