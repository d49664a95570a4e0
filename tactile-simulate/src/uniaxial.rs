//! A plain or patterned block or cylinder squeezed between two plates without friction: the case for which the paper's ratio (31),
//! E = S_zz / mean e_zz, is exact.
//!
//! The deformation is homogeneous, x = λ_t X, y = λ_t Y, z = λ_z Z, and the material obeys S = E·e in uniaxial stress, with
//! S the second Piola–Kirchhoff stress and e the Green–Lagrange strain (St. Venant–Kirchhoff):
//!
//! * e_zz = ½(λ_z² − 1), e_xx = e_yy = −ν e_zz, hence λ_t = √(1 − 2ν e_zz);
//! * S_zz = E e_zz; force F = −λ_z S_zz A₀; Cauchy's stress σ = λ_z S_zz/λ_t².
//!
//! From state 1 to state 2, with state 1 as the reference, e₁₂ = (e₂ − e₁)/λ₁² and S₁₂ = (S₂ − S₁)/λ₁² have the ratio E again.
//!
//! In small strain all the stresses agree; at 10 % they differ by as much. The force has a greatest value,
//! E A₀/(3√3) at λ_z = 1/√3, where this material law ends.
//!
//! The frame shows pressure in proportion to the pattern's height, normalised to carry the force.

use nalgebra::Point3;
use ndarray::Array2;

use super::error::SimulateError;
use super::light::Illumination;
use super::pixel_average::{Patch, touched};
use super::relief::{FaceOutline, Relief};
use super::uniaxial_options::UniaxialOptions;
use super::uniaxial_state::UniaxialState;

/// A checked scene of uniaxial compression.
///
/// ```
/// use tactile_simulate::{Camera, UniaxialOptions, UniaxialScene};
///
/// let camera = Camera::default().coarser(4);
/// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
/// let [first, second] = [scene.states()[0], scene.states()[1]];
/// // Counted from the first state, both are less by it, over λ₁².
/// let (stress, strain) = (second.second_piola_zz_pa - first.second_piola_zz_pa, second.strain_zz - first.strain_zz);
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
    /// Checks `options`, solves every state and places the pattern.
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`], [`SimulateError::TooFew`], or [`SimulateError::Overload`] for a force beyond
    /// E A₀/(3√3).
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

    /// What the scene was made from.
    pub fn options(&self) -> &UniaxialOptions {
        &self.options
    }

    /// Grey levels per pascal.
    pub fn grey_per_pascal(&self) -> f64 {
        self.grey_per_pascal
    }

    /// Stretch, strain and stress of every force.
    pub fn states(&self) -> &[UniaxialState] {
        &self.states
    }

    /// An exposure without contact; each `repeat` has its own noise.
    pub fn reference(&self, repeat: u32) -> Array2<u8> {
        self.options
            .camera
            .expose_reference(self.options.seed, repeat)
    }

    /// An exposure of state `load`; each `repeat` has its own noise.
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
    /// let seen_n = (&light - &dark).sum() / scene.grey_per_pascal() * camera.pixel_size_m.iter().product::<f64>();
    /// assert!((seen_n - scene.options().forces_n[1]).abs() < 1e-9);
    /// assert!((scene.pressure_pa(1).sum() * camera.pixel_size_m.iter().product::<f64>() - 0.7).abs() < 1e-9);
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

    /// Pressure in pascal averaged over each pixel; the sum times the pixel's area is the force.
    ///
    /// # Panics
    /// If there is no such state.
    pub fn pressure_pa(&self, load: usize) -> Array2<f64> {
        let mut field = Array2::zeros(self.options.camera.shape);
        self.pressure(load).add_to(&mut field);
        field
    }

    /// Height in metres per pascal of light in state `load`: pressure times this is the deformed height.
    ///
    /// # Panics
    /// If there is no such state.
    pub fn height_per_pascal_m(&self, load: usize) -> f64 {
        let s = &self.states[load];
        s.stretch_z * s.stretch_lateral.powi(2) * self.relief.volume_m3() / s.force_n
    }

    /// Deformed heights in metres at pixel centres, 0 off the face.
    ///
    /// ```
    /// use tactile_simulate::{Camera, UniaxialOptions, UniaxialScene};
    /// let camera = Camera::default().coarser(8);
    /// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
    /// let (height, middle) = (scene.height_m(2), [64, 86]);
    /// let from_light = scene.pressure_pa(2)[middle] * scene.height_per_pascal_m(2);
    /// assert!((from_light / height[middle] - 1.0).abs() < 0.05, "a pixel's mean and its centre");
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such state.
    pub fn height_m(&self, load: usize) -> Array2<f64> {
        let (s, centre, size) = (
            &self.states[load],
            self.centre_px(),
            self.options.camera.pixel_size_m,
        );
        Array2::from_shape_fn(self.options.camera.shape, |(row, col)| {
            let x = (col as f64 - centre[0]) * size[0] / s.stretch_lateral;
            let y = (row as f64 - centre[1]) * size[1] / s.stretch_lateral;
            s.stretch_z * self.relief.height_m([x, y])
        })
    }

    /// Material points of the undeformed surface: a grid of `columns` × `rows` cell centres over the face, in metres from the
    /// first pixel's centre, with the surface's height as z.
    pub fn material_points(&self, columns: usize, rows: usize) -> Vec<Point3<f64>> {
        let (size, centre) = (self.options.face_m, self.centre_m());
        let at = |k: usize, n: usize, side: f64| ((k as f64 + 0.5) / n as f64 - 0.5) * side;
        let mut points = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for col in 0..columns {
                let p = [at(col, columns, size[0]), at(row, rows, size[1])];
                points.push(Point3::new(
                    p[0] + centre[0],
                    p[1] + centre[1],
                    self.relief.height_m(p),
                ));
            }
        }
        points
    }

    /// Where a material point of the undeformed surface lies in state `load`.
    ///
    /// ```
    /// use tactile_simulate::{Camera, UniaxialOptions, UniaxialScene};
    /// let camera = Camera::default().coarser(16);
    /// let scene = UniaxialScene::new(UniaxialOptions { camera, ..UniaxialOptions::default() })?;
    /// let (points, state) = (scene.material_points(4, 3), scene.states()[2]);
    /// let moved: Vec<_> = points.iter().map(|p| scene.deform(2, p)).collect();
    /// assert!((moved[5].z / points[5].z - state.stretch_z).abs() < 1e-12);
    /// let width = |p: &[nalgebra::Point3<f64>]| p[3].x - p[0].x;
    /// assert!((width(&moved) / width(&points) - state.stretch_lateral).abs() < 1e-12, "it spreads");
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Panics
    /// If there is no such state.
    pub fn deform(&self, load: usize, point: &Point3<f64>) -> Point3<f64> {
        let (s, c) = (&self.states[load], self.centre_m());
        let lateral = |k: usize| c[k] + s.stretch_lateral * (point[k] - c[k]);
        Point3::new(lateral(0), lateral(1), s.stretch_z * point.z)
    }

    fn centre_px(&self) -> [f64; 2] {
        self.options.camera.centre_px(self.options.centre_px)
    }

    fn centre_m(&self) -> [f64; 2] {
        let (centre, size) = (self.centre_px(), self.options.camera.pixel_size_m);
        [centre[0] * size[0], centre[1] * size[1]]
    }

    /// Pixel averages of the pressure over the face and the blur's reach.
    fn pressure(&self, load: usize) -> Patch {
        let (s, camera, relief) = (&self.states[load], &self.options.camera, &self.relief);
        let centre = self.centre_px();
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
        let scale = s.force_n / (relief.volume_m3() * s.stretch_lateral * s.stretch_lateral);
        values.map_inplace(|v| *v *= scale);
        Patch {
            origin: [spans[1].0, spans[0].0],
            values,
        }
    }
}

/// values += height · column ⊗ line, where both differ from zero.
fn add_product(values: &mut Array2<f64>, height: f64, column: &[f64], line: &[f64]) {
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
