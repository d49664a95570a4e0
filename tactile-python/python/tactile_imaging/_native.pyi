from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Protocol, final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

__version__: str
__all__ = [
    "CheckPress",
    "Contact",
    "Estimate",
    "HertzContact",
    "Inclusion",
    "Lump",
    "Load",
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
    "match_points",
    "reconstruct",
    "run_program",
    "simulate",
    "strain_between",
]

_Floats = NDArray[np.float64]
_Frame = NDArray[np.uint8]
_Mask = NDArray[np.bool_]
_PixelSize = tuple[float, float]

# The stages that a user may write: an object with the one method.

class _Matcher(Protocol):
    def match_points(self, model: _Floats, target: _Floats, /) -> Any: ...

class _Reconstruction(Protocol):
    def reconstruct(self, image: _Floats, mask: _Mask, pixel_size: _PixelSize, /) -> ArrayLike: ...

class _Sampler(Protocol):
    def sample(
        self, heights: _Floats, mask: _Mask, pixel_size: _PixelSize, count: int, /
    ) -> ArrayLike: ...

class _Warp(Protocol):
    def __call__(self, points: _Floats, /) -> ArrayLike: ...
    def jacobian(self, points: _Floats, /) -> _Floats: ...

class _WarpModel(Protocol):
    def fit(self, sources: _Floats, targets: _Floats, weights: _Floats | None, /) -> _Warp: ...

class _StrainMeasure(Protocol):
    def strain(self, deformation_gradient: _Floats, /) -> ArrayLike: ...

class _Estimator(Protocol):
    def estimate(self, loads: list[Load], /) -> tuple[float, float]: ...

class _GuideEstimator(Protocol):
    counts_guide: bool
    def estimate(self, loads: list[Load], layers: _Floats, /) -> tuple[float, float]: ...

class _ContactStage(Protocol):
    def measure(self, frame: _Frame, reference: _Frame, /) -> dict[str, Any] | None: ...

class _Result:
    def _repr_html_(self) -> str: ...
    def to_dict(self) -> dict[str, Any]: ...

class TactileError(RuntimeError): ...

@final
class Estimate(_Result):
    @property
    def value(self) -> float: ...
    @property
    def standard_error(self) -> float: ...
    @property
    def interval_95(self) -> tuple[float, float | None]: ...

@final
class Modulus(_Result):
    @property
    def value(self) -> float: ...
    @property
    def standard_error(self) -> float: ...
    @property
    def interval_95(self) -> tuple[float, float | None]: ...
    @property
    def estimator(self) -> str: ...
    @property
    def flags(self) -> list[str]: ...

@final
class Load(_Result):
    @property
    def force(self) -> Estimate: ...
    @property
    def radius(self) -> Estimate | None: ...
    @property
    def area(self) -> Estimate | None: ...
    @property
    def indentation(self) -> Estimate | None: ...
    @property
    def strain(self) -> Estimate | None: ...

@final
class Contact(_Result):
    @property
    def force(self) -> Estimate | None: ...
    @property
    def radius(self) -> Estimate: ...
    @property
    def indentation(self) -> Estimate | None: ...
    @property
    def x(self) -> Estimate: ...
    @property
    def y(self) -> Estimate: ...
    @property
    def area(self) -> float: ...
    @property
    def touches_edge(self) -> bool: ...
    @property
    def flags(self) -> list[str]: ...

@final
class HertzContact(_Result):
    @property
    def contact_radius(self) -> float: ...
    @property
    def indentation(self) -> float: ...
    @property
    def peak_pressure(self) -> float: ...
    @property
    def mean_pressure(self) -> float: ...
    @property
    def stiffness(self) -> float: ...
    @property
    def reduced_modulus(self) -> float: ...

@final
class Surface(_Result):
    @property
    def heights(self) -> NDArray[np.float64]: ...
    @property
    def pixel_size(self) -> tuple[float, float]: ...
    @property
    def origin(self) -> tuple[float, float]: ...

@final
class Strain(_Result):
    @property
    def value(self) -> NDArray[np.float64]: ...
    @property
    def standard_error(self) -> NDArray[np.float64]: ...
    @property
    def spread(self) -> NDArray[np.float64]: ...
    @property
    def measure(self) -> str: ...
    @property
    def used(self) -> int: ...
    @property
    def flags(self) -> list[str]: ...

@final
class StrainBetween(_Result):
    @property
    def value(self) -> NDArray[np.float64]: ...
    @property
    def standard_error(self) -> NDArray[np.float64]: ...
    @property
    def interval_95(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def displacements(self) -> NDArray[np.float64]: ...
    @property
    def strains(self) -> NDArray[np.float64]: ...
    @property
    def standard_errors(self) -> NDArray[np.float64]: ...
    @property
    def displacement_gradients(self) -> NDArray[np.float64]: ...
    @property
    def displacement_gradient_errors(self) -> NDArray[np.float64]: ...
    @property
    def rotations_rad(self) -> NDArray[np.float64]: ...
    @property
    def principal_strains(self) -> NDArray[np.float64]: ...
    @property
    def principal_strain_errors(self) -> NDArray[np.float64]: ...
    @property
    def principal_directions(self) -> NDArray[np.float64]: ...
    @property
    def size_ratios(self) -> NDArray[np.float64]: ...
    @property
    def von_mises(self) -> NDArray[np.float64]: ...
    @property
    def sigma(self) -> float: ...
    @property
    def flags(self) -> list[str]: ...

@final
class Match(_Result):
    @property
    def assignment(self) -> NDArray[np.int64]: ...
    @property
    def confidence(self) -> NDArray[np.float64]: ...
    @property
    def warped(self) -> NDArray[np.float64]: ...
    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def sigma(self) -> float: ...
    @property
    def residual(self) -> float: ...
    @property
    def iterations(self) -> int: ...
    @property
    def rotation(self) -> list[float] | None: ...
    @property
    def rotation_error(self) -> list[float] | None: ...
    @property
    def scale(self) -> float | None: ...
    @property
    def scale_error(self) -> float | None: ...
    @property
    def shift(self) -> list[float] | None: ...
    @property
    def shift_error(self) -> list[float] | None: ...
    @property
    def flags(self) -> list[str]: ...

@final
class Lump(_Result):
    @property
    def x(self) -> Estimate | None: ...
    @property
    def y(self) -> Estimate | None: ...
    @property
    def diameter(self) -> Estimate: ...
    @property
    def depth(self) -> Estimate: ...
    @property
    def youngs_modulus(self) -> Estimate: ...
    @property
    def height_over_width(self) -> Estimate | None: ...
    @property
    def ball_probability(self) -> float: ...
    @property
    def identified(self) -> list[str]: ...

@final
class Inclusion(_Result):
    @property
    def verdict(self) -> str: ...
    @property
    def probability(self) -> float: ...
    @property
    def block_modulus(self) -> Estimate: ...
    @property
    def lumps(self) -> list[Lump]: ...
    @property
    def interface(self) -> str: ...
    @property
    def flags(self) -> list[str]: ...

@final
class SimulatedPress(_Result):
    @property
    def reference(self) -> NDArray[np.uint8]: ...
    @property
    def frames(self) -> list[NDArray[np.uint8]]: ...
    @property
    def pairs(self) -> NDArray[np.float64]: ...
    @property
    def pixel_size(self) -> tuple[float, float]: ...
    @property
    def waveguide(self) -> NDArray[np.float64]: ...
    @property
    def radius(self) -> float: ...
    @property
    def poisson_ratio(self) -> float: ...
    @property
    def estimator(self) -> str: ...
    @property
    def truth(self) -> dict[str, Any]: ...

@final
class Object:
    @classmethod
    def sphere(cls, radius: float, *, poisson_ratio: float = 0.5) -> Object: ...
    @classmethod
    def block(cls, *, poisson_ratio: float = 0.5) -> Object: ...
    @classmethod
    def cylinder(cls, *, poisson_ratio: float = 0.5) -> Object: ...
    @classmethod
    def flat_punch(cls, radius: float, *, poisson_ratio: float = 0.5) -> Object: ...
    @classmethod
    def cone(cls, half_angle: float, *, poisson_ratio: float = 0.5) -> Object: ...
    @classmethod
    def layer(
        cls, indenter_radius: float, thickness: float, *, poisson_ratio: float = 0.5
    ) -> Object: ...
    @classmethod
    def unknown(cls, *, poisson_ratio: float = 0.5) -> Object: ...

@final
class Sensor:
    @classmethod
    def load(cls, path: str | PathLike[str]) -> Sensor: ...
    @classmethod
    def calibrate(cls, path: str | PathLike[str]) -> Sensor: ...
    @classmethod
    def from_presses(
        cls,
        references: Sequence[ArrayLike],
        frames: Sequence[ArrayLike],
        forces: ArrayLike,
        radii: ArrayLike,
        pixel_size: ArrayLike,
        *,
        layers: ArrayLike | None = None,
        unloading: Sequence[bool] | None = None,
        pixel_size_error: float = 1e-3,
        gauge_error: float = 1e-3,
        gauge_noise: float = 2e-3,
        flat_field: bool = True,
        date: str = "",
    ) -> Sensor: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    def pressure(self, grey: ArrayLike) -> NDArray[np.float64]: ...
    @property
    def date(self) -> str: ...
    @property
    def pixel_size(self) -> tuple[float, float]: ...

@final
class Pipeline:
    def __new__(
        cls,
        object: Object,
        *,
        pairs: ArrayLike | None = None,
        sensor: Sensor | None = None,
        depth_table: ArrayLike | None = None,
        contact: _ContactStage | None = None,
        pixel_size: ArrayLike | None = None,
        waveguide: ArrayLike | None = None,
        control_points: int = 200,
        surface: str | _Reconstruction | None = None,
        sampler: str | _Sampler | None = None,
        matcher: str | _Matcher | None = None,
        matcher_options: Mapping[str, Any] | None = None,
        warp: str | _WarpModel | None = None,
        strain: str | _StrainMeasure | None = None,
        estimator: str | _Estimator | _GuideEstimator | None = None,
        flat_field: bool | None = None,
        force_scale_error: float | None = None,
        coupling_error: float | None = None,
        length_scale_error: float | None = None,
        radius_error: float | None = None,
        poisson_ratio_error: float | None = None,
        adhesion_error: float | None = None,
    ) -> Pipeline: ...
    def press(self, reference: ArrayLike) -> Press: ...
    def with_checks(self, reference: ArrayLike, checks: Sequence[CheckPress]) -> Pipeline: ...

@final
class CheckPress:
    @classmethod
    def sample(
        cls, frame: ArrayLike, force: float, *, force_error: float | None = None
    ) -> CheckPress: ...
    @classmethod
    def calibrator(
        cls, frame: ArrayLike, force: float, *, force_error: float | None = None
    ) -> CheckPress: ...
    @classmethod
    def ball(
        cls,
        frame: ArrayLike,
        force: float,
        radius: float,
        *,
        force_error: float | None = None,
        radius_error: float | None = None,
        youngs_modulus: float | None = None,
        youngs_modulus_error: float | None = None,
        poisson_ratio: float = 0.5,
        poisson_ratio_error: float = 0.01,
    ) -> CheckPress: ...

@final
class Press:
    def __new__(cls, pipeline: Pipeline, reference: ArrayLike) -> Press: ...
    @classmethod
    def from_scene(cls, path: str | PathLike[str]) -> Press: ...
    def add_frame(
        self,
        frame: ArrayLike,
        *,
        gauge: float | None = None,
        gauge_error: float = 0.0,
        time: float | None = None,
    ) -> int: ...
    def __len__(self) -> int: ...
    def image(self, frame: int) -> NDArray[np.uint8]: ...
    def contact(self, frame: int) -> Contact | None: ...
    def guide_depression(
        self, frame: int, distances: Sequence[float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None: ...
    def surface(self, frame: int) -> Surface: ...
    def control_points(self, frame: int) -> NDArray[np.float64]: ...
    def matching(self, frame: int) -> Match: ...
    def strain(self, frame: int) -> Strain: ...
    def modulus(self) -> Modulus: ...
    def estimates(self) -> list[Modulus]: ...
    def measure(self) -> dict[str, Any]: ...
    def summary(self) -> str: ...
    def plot(self, frame: int = -1) -> Figure: ...

@final
class Session:
    def __new__(cls, pipeline: Pipeline, references: Sequence[ArrayLike]) -> Session: ...
    def push(self, frame: ArrayLike) -> Contact | None: ...
    def __len__(self) -> int: ...
    def strain(self) -> Strain | None: ...
    def modulus(self) -> Modulus: ...

@final
class ThinPlateSpline:
    def __new__(
        cls,
        sources: ArrayLike,
        targets: ArrayLike,
        *,
        smoothing: float | str | None = None,
        kernel: str = "thin_plate_spline",
    ) -> ThinPlateSpline: ...
    def __call__(self, points: ArrayLike) -> NDArray[np.float64]: ...
    def jacobian(self, points: ArrayLike) -> NDArray[np.float64]: ...
    @property
    def smoothing(self) -> float: ...

def depth(
    frame: ArrayLike, reference: ArrayLike, table: ArrayLike, pixel_size: ArrayLike
) -> Surface | None: ...
def estimate_modulus(
    forces: ArrayLike,
    radii: ArrayLike,
    object: Object,
    *,
    waveguide: ArrayLike | None = None,
    estimator: str | None = None,
) -> Modulus: ...
def hertz(
    force: float,
    radius: float,
    youngs_modulus: float,
    *,
    poisson_ratio: float = 0.5,
    other_modulus: float | None = None,
    other_poisson_ratio: float = 0.5,
) -> HertzContact: ...
def inclusion(
    radii: ArrayLike,
    approaches: ArrayLike,
    pressures: ArrayLike,
    standard_errors: ArrayLike,
    *,
    block_height: float,
    block_radius: float,
    guide_radius: float,
    waveguide: ArrayLike,
    forces: ArrayLike | None = None,
    interface: str | None = None,
    youngs_modulus: tuple[float, float] | None = None,
) -> Inclusion: ...
def inclusion_of_scene(path: str | PathLike[str]) -> Inclusion: ...
def integrate(
    slope_x: ArrayLike,
    slope_y: ArrayLike,
    pixel_size: ArrayLike | None = None,
    *,
    method: str | None = None,
    mask: ArrayLike | None = None,
) -> NDArray[np.float64]: ...
def match_points(
    model: ArrayLike,
    target: ArrayLike,
    matcher: str | _Matcher | None = None,
    **options: Any,
) -> Match: ...
def reconstruct(
    image: ArrayLike,
    *,
    light: tuple[float, float, float] | None = None,
    method: str | None = None,
    mask: ArrayLike | None = None,
    pixel_size: ArrayLike | None = None,
    intensity: float = 1.0,
    ambient: float = 0.0,
) -> NDArray[np.float64]: ...
def run_program(arguments: Sequence[str]) -> int: ...
def simulate(
    *,
    forces: Sequence[float] | None = None,
    radius: float = 3e-3,
    youngs_modulus: float = 103e3,
    poisson_ratio: float = 0.5,
    physics: str = "finite-elements",
    coarser: int = 1,
    seed: int = 1,
) -> SimulatedPress: ...
def strain_between(
    before: ArrayLike,
    after: ArrayLike,
    matcher: str | _Matcher | None = None,
    *,
    measure: str | _StrainMeasure | None = None,
    paired: bool = False,
    with_doubtful_pairs: bool = False,
    **options: Any,
) -> StrainBetween: ...
