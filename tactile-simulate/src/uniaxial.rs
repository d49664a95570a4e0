//! A plain or patterned block or cylinder compressed between two plates without friction: the case
//! for which the paper's ratio (31), E = S_zz / mean e_zz, is exact.
//!
//! The deformation is homogeneous, x = λ_t X, y = λ_t Y, z = λ_z Z, and the material obeys S = E·e
//! in uniaxial stress, with S the second Piola–Kirchhoff stress and e the Green–Lagrange strain
//! (St. Venant–Kirchhoff):
//!
//! * e_zz = ½(λ_z² − 1), e_xx = e_yy = −ν e_zz, hence λ_t = √(1 − 2ν e_zz);
//! * S_zz = E e_zz; force F = −λ_z S_zz A₀; Cauchy's stress σ = λ_z S_zz/λ_t².
//!
//! From state 1 to state 2, with state 1 as the reference, e₁₂ = (e₂ − e₁)/λ₁² and S₁₂ = (S₂ −
//! S₁)/λ₁², whose ratio is again E.
//!
//! At small strain all stresses agree. At 10 % they differ by the same amount. The force has a
//! maximum, E A₀/(3√3) at λ_z = 1/√3, where this material law ends.
//!
//! The frame shows a pressure proportional to the height of the pattern, normalised to carry the
//! force.
//!
//! On a rectangular face the height is h(X, Y) = h₀ + h₁ Σₖ b((X − Xₖ)/w) b((Y − Yₖ)/w) with b(t) =
//! cos²(πt/2) for |t| < 1, and 0 outside. It has a continuous slope, and each bump lies entirely on
//! the face. The integral ∫b = (t + sin(πt)/π)/2 has a closed form, so the average over a pixel is
//! a product of two differences.

use crate::camera::{Camera, Purpose, row_stream};
use crate::error::{SimulateError, at_least, finite, not_negative, positive, within};
use crate::light::Illumination;
use crate::materials::Elastic;
use crate::pixel_average::{PixelPatch, touched};
use crate::press::Gain;
use ndarray::Array2;
use rand_distr::{Distribution, Uniform};
use std::f64::consts::PI;

/// A validated scene of uniaxial compression.
///
/// ```
/// use tactile_simulate::{Camera, UniaxialOptions, UniaxialScene};
///
/// let camera = Camera::default().coarser(4);
/// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
/// let [first, second] = [scene.states()[0], scene.states()[1]];
/// // Relative to the first state, both are reduced by its value and divided by λ₁².
/// let (stress, strain) = (
///     second.second_piola_zz_pa - first.second_piola_zz_pa,
///     second.strain_zz - first.strain_zz,
/// );
/// assert!((stress / strain / 103e3 - 1.0).abs() < 1e-12);
/// let frame = scene.frame(1, 0);
/// assert_eq!(frame.dim(), (260, 348));
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct UniaxialScene {
    options: UniaxialOptions,
    states: Vec<UniaxialState>,
    relief: Relief,
    grey_per_pascal: f64,
}

impl UniaxialScene {
    /// Validates `options`, solves each state and places the pattern.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`], [`SimulateError::TooFew`], or [`SimulateError::Overload`] for
    /// a force above E A₀/(3√3).
    pub fn new(options: UniaxialOptions) -> Result<Self, SimulateError> {
        options.validate()?;
        let area0 = options.outline.area_m2(options.face_m);
        let solve = |&f: &f64| UniaxialState::new(&options.material, area0, f);
        let states = options
            .forces_n
            .iter()
            .map(solve)
            .collect::<Result<Vec<_>, _>>()?;
        let relief = options
            .pattern
            .place(options.outline, options.face_m, options.seed);
        let mut scene = Self {
            options,
            states,
            relief,
            grey_per_pascal: 1.0,
        };
        let loads = 0..scene.states.len();
        let largest_pa = loads
            .flat_map(|k| scene.pressure(k).values)
            .fold(0.0, f64::max);
        scene.grey_per_pascal = scene.options.gain.grey_per_pascal(largest_pa);
        Ok(scene)
    }

    /// The options of the scene.
    pub fn options(&self) -> &UniaxialOptions {
        &self.options
    }

    /// Grey levels per pascal.
    pub fn grey_per_pascal(&self) -> f64 {
        self.grey_per_pascal
    }

    /// Stretch, strain and stress at each force.
    pub fn states(&self) -> &[UniaxialState] {
        &self.states
    }

    /// An exposure without contact. Each `repeat` has its own noise.
    pub fn reference(&self, repeat: u32) -> Array2<u8> {
        self.options
            .camera
            .expose_reference(self.options.seed, repeat)
    }

    /// An exposure of state `load`. Each `repeat` has its own noise.
    ///
    /// # Panics
    /// If there is no such state.
    pub fn frame(&self, load: usize, repeat: u32) -> Array2<u8> {
        let light = self.expected_frame(load);
        self.options
            .camera
            .expose_load(light.view(), self.options.seed, load, repeat)
    }

    /// Expected grey levels of state `load`, before noise and rounding.
    ///
    /// ```
    /// use tactile_simulate::{Camera, UniaxialOptions, UniaxialScene};
    /// let camera = Camera::default().coarser(16).ideal();
    /// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
    /// let (light, dark) = (scene.expected_frame(1), scene.reference(0).mapv(f64::from));
    /// let seen_n = (&light - &dark).sum() / scene.grey_per_pascal()
    ///     * camera.pixel_size_m.iter().product::<f64>();
    /// assert!((seen_n - scene.options().forces_n[1]).abs() < 1e-9);
    /// assert!(
    ///     (scene.pressure_pa(1).sum() * camera.pixel_size_m.iter().product::<f64>() - 0.7).abs()
    ///         < 1e-9
    /// );
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such state.
    pub fn expected_frame(&self, load: usize) -> Array2<f64> {
        let mut patch = self.pressure(load);
        patch.values.map_inplace(|v| *v *= self.grey_per_pascal);
        self.options.camera.blur(&mut patch);
        self.options
            .camera
            .compose(&[patch], &Illumination::default())
    }

    /// Pressure in pascals averaged over each pixel. The sum times the pixel area is the force.
    ///
    /// # Panics
    /// If there is no such state.
    pub fn pressure_pa(&self, load: usize) -> Array2<f64> {
        let mut field = Array2::zeros(self.options.camera.shape);
        self.pressure(load).add_to(&mut field);
        field
    }

    fn centre_px(&self) -> [f64; 2] {
        self.options.camera.centre_px(self.options.centre_px)
    }

    /// Pixel averages of the pressure over the face and the reach of the blur.
    fn pressure(&self, load: usize) -> PixelPatch {
        let (s, camera, relief) = (&self.states[load], &self.options.camera, &self.relief);
        let centre = self.centre_px();
        // Size of a pixel in material coordinates: the face spreads while the pixel keeps its size.
        let pixel: [f64; 2] = std::array::from_fn(|k| camera.pixel_size_m[k] / s.stretch_lateral);
        // First pixel and pixel edges in material coordinates, along x and y.
        let span = |k: usize, length: usize| {
            let half = 0.5 * self.options.face_m[k] / pixel[k];
            let [first, last] = touched(centre[k], half, length, camera.blur_reach());
            let edges = (first..=last)
                .map(|i| (i as f64 - 0.5 - centre[k]) * pixel[k])
                .collect::<Vec<_>>();
            (first, edges)
        };
        let spans = [span(0, camera.shape[1]), span(1, camera.shape[0])];
        let means = |k: usize, integral: &dyn Fn(f64) -> f64| -> Vec<f64> {
            spans[k]
                .1
                .windows(2)
                .map(|e| (integral(e[1]) - integral(e[0])) / pixel[k])
                .collect()
        };
        let mut values = Array2::zeros((spans[1].1.len() - 1, spans[0].1.len() - 1));
        match relief.outline {
            FaceOutline::Rectangle => {
                let face = |k: usize| means(k, &|x| relief.face_integral(k, x));
                add_product(&mut values, relief.base_height_m, &face(1), &face(0));
            }
            FaceOutline::Ellipse => {
                values = relief.covered_by_ellipse(&spans[1].1, &spans[0].1);
                values *= relief.base_height_m;
            }
        }
        for bump in &relief.bumps {
            let profile = |k: usize| means(k, &|x| relief.bump_integral(bump, k, x));
            add_product(&mut values, bump.height_m, &profile(1), &profile(0));
        }
        // The deformed face is larger by λ_t². The pressures of the pixels then add up to the
        // force.
        let scale = s.force_n / (relief.volume_m3() * s.stretch_lateral * s.stretch_lateral);
        values.map_inplace(|v| *v *= scale);
        PixelPatch {
            origin: [spans[1].0, spans[0].0],
            values,
        }
    }
}

/// values += height · column ⊗ line, restricted to non-zero entries.
fn add_product(values: &mut Array2<f64>, height: f64, column: &[f64], line: &[f64]) {
    // A bump covers few pixels; the remaining products are zero.
    let first = line.iter().position(|&v| v != 0.0).unwrap_or(line.len());
    let last = line
        .iter()
        .rposition(|&v| v != 0.0)
        .map_or(first, |k| k + 1);
    for (mut row, &c) in values.rows_mut().into_iter().zip(column) {
        if c != 0.0 {
            row.iter_mut()
                .zip(line)
                .take(last)
                .skip(first)
                .for_each(|(v, &l)| *v += height * c * l);
        }
    }
}

/// Description of the compressed block, validated by
/// [`UniaxialScene::new`](crate::UniaxialScene::new).
///
/// ```
/// use tactile_simulate::{Camera, Elastic, UniaxialOptions, UniaxialScene};
/// let options = UniaxialOptions {
///     material: Elastic::CL2003X,
///     face_m: [10e-3, 14e-3],
///     forces_n: vec![0.1, 0.4],
///     camera: Camera::default().coarser(16),
///     ..UniaxialOptions::default()
/// };
/// let state = UniaxialScene::new(options)?.states()[1];
/// assert!((state.second_piola_zz_pa / state.strain_zz - 62e3).abs() < 1e-6, "Young's modulus");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UniaxialOptions {
    /// Material of the block.
    pub material: Elastic,
    /// Outline of the face.
    #[cfg_attr(feature = "serde", serde(default))]
    pub outline: FaceOutline,
    /// Sides of the undeformed face (x, y), or axes of its ellipse, in metres.
    pub face_m: [f64; 2],
    /// Pattern of its surface.
    pub pattern: SurfacePattern,
    /// Forces in newtons, one frame each. 0 gives no light.
    pub forces_n: Vec<f64>,
    /// Centre (x, y) of the face in pixels. `None` for the centre of the frame.
    pub centre_px: Option<[f64; 2]>,
    /// Camera, lens and stray light.
    pub camera: Camera,
    /// Grey levels per pascal.
    pub gain: Gain,
    /// Seed of noise and pattern.
    pub seed: u64,
}

impl Default for UniaxialOptions {
    /// A CL2000X block of 12 × 12 mm at 0.2, 0.7 and 1.2 N: compressed by 1, 5 and 9 %.
    fn default() -> Self {
        Self {
            material: Elastic::CL2000X,
            outline: FaceOutline::default(),
            face_m: [12e-3; 2],
            pattern: SurfacePattern::default(),
            forces_n: vec![0.2, 0.7, 1.2],
            centre_px: None,
            camera: Camera::default(),
            gain: Gain::PeakGrey(200.0),
            seed: 1,
        }
    }
}

impl UniaxialOptions {
    fn validate(&self) -> Result<(), SimulateError> {
        self.material.validate()?;
        positive("youngs_modulus_pa", self.material.youngs_modulus_pa)?;
        self.pattern.validate()?;
        self.camera.validate()?;
        at_least("forces_n", self.forces_n.len(), 1)?;
        for &force in &self.forces_n {
            not_negative("the force in N", force)?;
        }
        for k in 0..2 {
            positive("face_m", self.face_m[k])?;
            finite("centre_px", self.centre_px.map_or(0.0, |c| c[k]))?;
        }
        self.gain.validate()
    }
}

/// Stretch, strain and stress at one force. Compression is negative.
///
/// ```
/// use tactile_simulate::{UniaxialOptions, UniaxialScene};
/// let scene = UniaxialScene::new(UniaxialOptions::default())?;
/// let state = scene.states()[2]; // 1.2 N on a block of 103 kPa
/// assert!((state.second_piola_zz_pa - 103e3 * state.strain_zz).abs() < 1e-9, "S = E e");
/// assert!((state.cauchy_zz_pa * state.area_m2 + 1.2).abs() < 1e-12, "compression is negative");
/// let volume = state.stretch_z * state.stretch_lateral.powi(2);
/// assert!(state.stretch_z < 1.0 && (volume - 1.0).abs() < 0.02, "ν = ½ in small strain");
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct UniaxialState {
    /// Compressive force in newtons.
    pub force_n: f64,
    /// λ_z.
    pub stretch_z: f64,
    /// λ_t.
    pub stretch_lateral: f64,
    /// Green–Lagrange strain e_zz.
    pub strain_zz: f64,
    /// Second Piola–Kirchhoff stress S_zz in pascals.
    pub second_piola_zz_pa: f64,
    /// Cauchy stress in pascals: the negative force over the deformed face.
    pub cauchy_zz_pa: f64,
    /// Deformed face in square metres.
    pub area_m2: f64,
}

impl UniaxialState {
    fn new(material: &Elastic, area0_m2: f64, force_n: f64) -> Result<Self, SimulateError> {
        let e = material.youngs_modulus_pa;
        // Nominal stress over modulus: λ(1 − λ²)/2, largest at 1/√3.
        let load = force_n / (e * area0_m2);
        let limit = 1.0 / 27.0_f64.sqrt();
        if load >= limit {
            return Err(SimulateError::Overload {
                force_n,
                limit_n: limit * e * area0_m2,
            });
        }
        // λ³ − λ + 2·load = 0: the largest of three real roots, by the cosine formula.
        let stretch = 2.0 / 3.0_f64.sqrt() * ((-load / limit).acos() / 3.0).cos();
        // As a product, because λ² − 1 loses digits at small strain.
        let strain_zz = 0.5 * (stretch - 1.0) * (stretch + 1.0);
        let stretch_lateral = (1.0 - 2.0 * material.poisson_ratio * strain_zz).sqrt();
        let area_m2 = area0_m2 * stretch_lateral * stretch_lateral;
        Ok(Self {
            force_n,
            stretch_z: stretch,
            stretch_lateral,
            strain_zz,
            second_piola_zz_pa: e * strain_zz,
            cauchy_zz_pa: -force_n / area_m2,
            area_m2,
        })
    }
}

/// Outline of a compressed face.
///
/// ```
/// use tactile_simulate::{Camera, FaceOutline, UniaxialOptions, UniaxialScene};
/// let camera = Camera::default().coarser(16);
/// let disc = UniaxialOptions {
///     outline: FaceOutline::Ellipse,
///     face_m: [12e-3; 2],
///     camera,
///     ..UniaxialOptions::default()
/// };
/// let scene = UniaxialScene::new(disc)?;
/// let state = scene.states()[0];
/// let undeformed = state.area_m2 / state.stretch_lateral.powi(2);
/// assert!((undeformed / (std::f64::consts::PI * 36e-6) - 1.0).abs() < 1e-12);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FaceOutline {
    /// A rectangle with the sides of the face, for a block.
    #[default]
    Rectangle,
    /// The inscribed ellipse, for a cylinder. Bumps that are not entirely on it are omitted.
    Ellipse,
}

impl FaceOutline {
    /// Area of a face with these sides.
    fn area_m2(self, size_m: [f64; 2]) -> f64 {
        let rectangle = size_m[0] * size_m[1];
        match self {
            Self::Rectangle => rectangle,
            Self::Ellipse => 0.25 * PI * rectangle,
        }
    }

    /// Whether the box around a point lies on a face with these sides.
    fn holds(self, at: [f64; 2], half_width_m: f64, size_m: [f64; 2]) -> bool {
        let reach: [f64; 2] =
            std::array::from_fn(|k| (at[k].abs() + half_width_m) / (0.5 * size_m[k]));
        match self {
            Self::Rectangle => true,
            Self::Ellipse => reach[0].hypot(reach[1]) <= 1.0,
        }
    }
}

/// Bumps on a plain face.
///
/// ```
/// use tactile_simulate::{Camera, SurfacePattern, UniaxialOptions, UniaxialScene};
/// let camera = Camera::default().coarser(16);
/// let pattern = SurfacePattern {
///     bumps: [3, 3],
///     bump_height_m: [0.4e-3, 0.4e-3],
///     ..SurfacePattern::default()
/// };
/// let scene = UniaxialScene::new(UniaxialOptions {
///     camera,
///     pattern,
///     ..UniaxialOptions::default()
/// })?;
/// // The pressure is proportional to the height: bumps press harder than the average of the face.
/// let highest = scene.pressure_pa(0).into_iter().fold(0.0, f64::max);
/// assert!(highest > -1.2 * scene.states()[0].cauchy_zz_pa);
/// # Ok::<(), tactile_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SurfacePattern {
    /// Height of the plain face in metres.
    pub base_height_m: f64,
    /// Smallest and largest height of the bumps above it, in metres.
    pub bump_height_m: [f64; 2],
    /// Columns and rows of bumps: one in each cell of a grid, at a random position in its cell.
    pub bumps: [usize; 2],
    /// Half width w of a bump as a fraction of the shorter side of the cell, up to ½.
    pub bump_share: f64,
}

impl Default for SurfacePattern {
    /// A 0.5 mm base with 8×8 bumps of 0.3 to 0.6 mm.
    fn default() -> Self {
        Self {
            base_height_m: 0.5e-3,
            bump_height_m: [0.3e-3, 0.6e-3],
            bumps: [8, 8],
            bump_share: 0.4,
        }
    }
}

impl SurfacePattern {
    fn validate(&self) -> Result<(), SimulateError> {
        positive("base_height_m", self.base_height_m)?;
        not_negative("bump_height_m", self.bump_height_m[0])?;
        within(
            "bump_height_m",
            self.bump_height_m[1],
            self.bump_height_m[0],
            f64::MAX,
        )?;
        at_least("bumps", self.bumps[0].min(self.bumps[1]), 1)?;
        within(
            "bumps",
            self.bumps[0].max(self.bumps[1]) as f64,
            1.0,
            1000.0,
        )?;
        within("bump_share", self.bump_share, 1e-6, 0.5)
    }

    /// Places the bumps on a face of `size_m` centred at the origin.
    fn place(&self, outline: FaceOutline, size_m: [f64; 2], seed: u64) -> Relief {
        let mut rng = row_stream(seed, Purpose::Pattern, 0, 0);
        let cell: [f64; 2] = std::array::from_fn(|k| size_m[k] / self.bumps[k] as f64);
        let half_width_m = self.bump_share * cell[0].min(cell[1]);
        let mut uniform = |low: f64, high: f64| match Uniform::new_inclusive(low, high) {
            Ok(law) => law.sample(&mut rng),
            Err(_) => low, // an interval closed by rounding
        };
        let mut bumps = Vec::with_capacity(self.bumps[0] * self.bumps[1]);
        for row in 0..self.bumps[1] {
            for col in 0..self.bumps[0] {
                let at = [col, row];
                let centre_m = std::array::from_fn(|k| {
                    let low = -0.5 * size_m[k] + at[k] as f64 * cell[k] + half_width_m;
                    uniform(low, low + cell[k] - 2.0 * half_width_m)
                });
                bumps.push(Bump {
                    centre_m,
                    height_m: uniform(self.bump_height_m[0], self.bump_height_m[1]),
                });
            }
        }
        // Removed after all random numbers are drawn, so that the outline does not move the
        // remaining bumps.
        bumps.retain(|bump: &Bump| outline.holds(bump.centre_m, half_width_m, size_m));
        Relief {
            outline,
            size_m,
            base_height_m: self.base_height_m,
            half_width_m,
            bumps,
        }
    }
}

/// One bump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bump {
    pub centre_m: [f64; 2],
    pub height_m: f64,
}

/// A placed pattern: heights over the material coordinates (X, Y) of the undeformed face.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Relief {
    outline: FaceOutline,
    size_m: [f64; 2],
    base_height_m: f64,
    half_width_m: f64,
    pub bumps: Vec<Bump>,
}

impl Relief {
    /// Volume between the face's plane and its heights, in cubic metres.
    fn volume_m3(&self) -> f64 {
        let bumps: f64 = self.bumps.iter().map(|b| b.height_m).sum();
        self.base_height_m * self.outline.area_m2(self.size_m)
            + bumps * self.half_width_m * self.half_width_m
    }

    /// Fractions of the cells between `rows` (y) and `columns` (x), edges in material coordinates,
    /// that are covered by an elliptic face. They are differences of the area of the unit disc to
    /// the lower left of the cells' corners.
    fn covered_by_ellipse(&self, rows: &[f64], columns: &[f64]) -> Array2<f64> {
        let half = self.size_m.map(|side| 0.5 * side);
        let corner = |row: usize, column: usize| {
            disc_below(columns[column] / half[0], rows[row] / half[1]) * half[0] * half[1]
        };
        let corners = Array2::from_shape_fn((rows.len(), columns.len()), |(r, c)| corner(r, c));
        Array2::from_shape_fn((rows.len() - 1, columns.len() - 1), |(r, c)| {
            let covered = corners[[r + 1, c + 1]] - corners[[r + 1, c]] - corners[[r, c + 1]]
                + corners[[r, c]];
            let cell = (rows[r + 1] - rows[r]) * (columns[c + 1] - columns[c]);
            // Differences of areas near 1 can be slightly below 0 or above 1 by rounding.
            (covered / cell).clamp(0.0, 1.0)
        })
    }

    /// ∫ of the plain face's indicator from −∞ to `x` along axis `k`, in metres.
    fn face_integral(&self, k: usize, x: f64) -> f64 {
        let half = 0.5 * self.size_m[k];
        x.clamp(-half, half) + half
    }

    /// ∫ of a bump's profile from −∞ to `x` along axis `k`, in metres.
    fn bump_integral(&self, bump: &Bump, k: usize, x: f64) -> f64 {
        let t = ((x - bump.centre_m[k]) / self.half_width_m).clamp(-1.0, 1.0);
        0.5 * self.half_width_m * (1.0 + t + (PI * t).sin() / PI)
    }
}

/// Area of the unit disc with X ≤ x and Y ≤ y: ∫ (min(y, h) + h) dt over t from −1 to x with h =
/// √(1 − t²), where y ≥ −h.
pub(crate) fn disc_below(x: f64, y: f64) -> f64 {
    let (x, y) = (x.clamp(-1.0, 1.0), y.clamp(-1.0, 1.0));
    // ∫ h from 0 to t.
    let half_disc = |t: f64| 0.5 * (t * (1.0 - t * t).max(0.0).sqrt() + t.asin());
    // Between −c and c the line Y = y is inside the disc.
    let c = (1.0 - y * y).max(0.0).sqrt();
    let inside = |to: f64| to.clamp(-c, c) + c;
    let whole = half_disc(x) - half_disc(-1.0);
    let chord = half_disc(x.clamp(-c, c)) - half_disc(-c);
    // The integrand is y + h where the line is inside. Beside the chord it is 2 h for a line above
    // the middle of the disc, and zero for one below it.
    let beside = whole - chord;
    y * inside(x) + chord + if y >= 0.0 { 2.0 * beside } else { 0.0 }
}
