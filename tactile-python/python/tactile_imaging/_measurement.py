"""The dictionary that `Press.measure` returns, for type checkers. Units are SI."""

from __future__ import annotations

from typing import Any, TypedDict


class Failure(TypedDict):
    """Why a result is missing."""

    error: str


class _Number(TypedDict):
    value: float
    standard_error: float
    interval_95: list[float | None]


class NumberValues(_Number, total=False):
    """A number with its errors. Without `degrees_of_freedom` the error is known exactly."""

    degrees_of_freedom: float


class ModulusValues(_Number):
    """Young's modulus by an estimator."""

    estimator: str
    warnings: list[str]


class ErrorShareValues(TypedDict):
    """Relative error of the modulus from one source."""

    source: str
    relative_error: float
    assumed: bool


class FrameValues(TypedDict):
    """Results of one frame."""

    force_n: NumberValues | Failure
    gauge_force_n: float | None
    contact_radius_m: NumberValues
    contact_ratio: float | None
    centroid_px: list[NumberValues]
    contact_area_m2: float
    mean_stress_pa: NumberValues | None
    surface_height_m: NumberValues | Failure
    surface_apparent: bool
    guide_depression_m: NumberValues | None


class StrainValues(TypedDict):
    """Strain between the first frame and the last, tensors by rows."""

    measure: str
    apparent: bool
    mean: list[list[float]]
    standard_error: list[list[float]]
    spread: list[list[float]]
    used: int
    folded: int


class MatchValues(TypedDict):
    """Match of the control points of the first frame and the last."""

    points: int
    matched: int
    mean_confidence: float
    residual_m: float
    mean_displacement_m: float
    iterations: int
    stop: str


class TimeValues(TypedDict):
    """Change of the modulus over the times of the frames."""

    from_s: float
    to_s: float
    loads: int
    change: Any


class CheckedGainValues(TypedDict):
    """Gain of the sensor by presses of known force."""

    gain: NumberValues
    drift: float
    presses: int


class CheckedGuideValues(TypedDict):
    """Stiffness of the guide by presses of balls of known modulus."""

    stiffness: NumberValues
    presses: int


class StageValues(TypedDict):
    """Runs of a stage and their time."""

    stage: str
    runs: int
    milliseconds: float


class ReportValues(TypedDict):
    """Stages that ran, and those that were skipped."""

    stages: list[StageValues]
    skips: list[dict[str, Any]]


class Measurement(TypedDict):
    """All results of a press, or the reasons of missing ones."""

    youngs_modulus_pa: ModulusValues | Failure
    time: TimeValues | None
    checked_gain: CheckedGainValues | None
    checked_guide: CheckedGuideValues | None
    error_budget: list[ErrorShareValues]
    estimators: list[ModulusValues]
    frames: list[FrameValues | Failure]
    strain: StrainValues | Failure
    match: MatchValues | Failure
    flags: list[dict[str, Any]]
    report: ReportValues
