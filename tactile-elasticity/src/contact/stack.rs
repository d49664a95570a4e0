//! The surface of bonded elastic layers under a pressure wave.
//!
//! Under a normal traction p̂ J₀(kr) every layer deforms as W(z) J₀(kr), U(z) J₁(kr) with the tractions Σ and T, in units of 2kG.
//! With y = kz growing upwards the state v = (W, U, Σ, T) obeys dv/dy = Mv,
//!
//! Ẇ = −nU + (1 − n)Σ,  U̇ = W + 2T,  Σ̇ = −T,  Ṫ = (1 + n)U + nΣ,  n = ν/(1 − ν),
//!
//! in which nothing is singular at ν = ½. As (M² − 1)² = 0, the transfer matrix exp(yM) is a cubic in M. It is not chained, which
//! would lose all digits at large y; instead the compliance F with (W, U) = F (Σ, T) is carried from the base to the surface, layer by
//! layer: the growing waves dominate numerator and denominator alike, and their ratio keeps its digits at every kh.
//!
//! Where the touched layer is deep beside the wave, 1 − L is small and would be rounding alone. There the wave that its lower face
//! sends back, e^(−2y) times a reflection, gives 1 − L itself.

use super::Bond;
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Matrix4x2, Vector4};

/// A layer in units of the stack's thickness and of the top layer's shear modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StackLayer {
    pub(crate) thickness: f64,
    pub(crate) shear_modulus: f64,
    pub(crate) poisson_ratio: f64,
}

/// Layers on a rigid base, the touched one first; never empty.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Stack {
    layers: Vec<StackLayer>,
    bond: Bond,
}

/// Beyond this kh a layer is a half-space to the last digit: what lies below counts with y²e^(−2y).
const DEEP: f64 = 30.0;

impl Stack {
    pub(crate) fn new(layers: Vec<StackLayer>, bond: Bond) -> Self {
        Self { layers, bond }
    }

    /// Thickness of the touched layer over that of the stack.
    pub(crate) fn top_thickness(&self) -> f64 {
        self.layers[0].thickness
    }

    /// 1 − L(s): how much less the surface yields at s = kh than a half-space of the touched layer, over what that yields.
    pub(crate) fn deficit(&self, s: f64) -> f64 {
        let Some((top, lower)) = self.layers.split_first().filter(|_| s > 1e-9) else {
            return 1.0; // long waves move nothing
        };
        let mut below = Face::Base(self.bond);
        for layer in lower.iter().rev() {
            below = Face::Compliant(layer.compliance(s, &below));
        }
        let half_space = top.half_space()[(0, 0)];
        let y = s * top.thickness;
        if y > 1.0 {
            top.less_than_half_space(y, &below)[(0, 0)] / half_space
        } else {
            1.0 - top.compliance(s, &below)[(0, 0)] / half_space
        }
    }
}

/// What a layer's lower face lies on.
enum Face {
    Base(Bond),
    /// Layers with this compliance, in units of the touched layer's modulus.
    Compliant(Matrix2<f64>),
}

impl StackLayer {
    /// F at the layer's upper face.
    fn compliance(&self, s: f64, below: &Face) -> Matrix2<f64> {
        let y = s * self.thickness;
        if y > DEEP {
            return self.half_space();
        }
        let identity = Matrix2::identity();
        let normal = Matrix2::new(1.0, 0.0, 0.0, 0.0);
        // Displacements and tractions of two independent solutions at the lower face, a column each.
        let (displacements, tractions) = match below {
            Face::Compliant(compliance) => (*compliance, identity),
            Face::Base(Bond::Bonded) => (Matrix2::zeros(), identity),
            Face::Base(Bond::Free) => (identity - normal, normal),
        };
        let state = self.transfer(y) * stacked(displacements, tractions / self.shear_modulus);
        let displacements = state.fixed_rows::<2>(0).into_owned();
        let tractions = state.fixed_rows::<2>(2) * self.shear_modulus;
        displacements * inverse(tractions)
    }

    /// F of a half-space of this layer less F at its upper face: e^(−2y)(D − F T)ρ(T₀ + e^(−2y) Tρ)⁻¹, D and T the
    /// displacements and tractions of the waves that decay upwards, T₀ of those that grow, ρ the reflection at the lower face.
    fn less_than_half_space(&self, y: f64, below: &Face) -> Matrix2<f64> {
        let unit = self.shear_modulus;
        // The two rows that vanish at the lower face.
        let condition = match below {
            Face::Compliant(f) => {
                let mut rows = Matrix2x4::identity();
                rows.fixed_columns_mut::<2>(2).copy_from(&(f * -unit));
                rows
            }
            Face::Base(Bond::Bonded) => Matrix2x4::identity(),
            Face::Base(Bond::Free) => Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        };
        let reflection = inverse(condition * self.decaying(0.0)) * (condition * self.growing(-y));
        let returned = self.decaying(y) * reflection * (-2.0 * y).exp();
        let displacements = returned.fixed_rows::<2>(0);
        let tractions = returned.fixed_rows::<2>(2) * unit;
        let growing = self.growing(0.0).fixed_rows::<2>(2) * unit;
        (displacements - self.half_space() * tractions) * inverse(growing - tractions)
    }

    /// The two waves that decay upwards, at height y above where they are counted from, less their e^(−y).
    fn decaying(&self, y: f64) -> Matrix4x2<f64> {
        let nu = self.poisson_ratio;
        let w = Vector4::new(1.0, 1.0, -1.0, -1.0);
        let yw = Vector4::new(
            y,
            y - (3.0 - 4.0 * nu),
            1.0 - 2.0 * nu - y,
            2.0 - 2.0 * nu - y,
        );
        Matrix4x2::from_columns(&[w, yw])
    }

    /// The two waves that grow upwards, at height y, less their e^y.
    fn growing(&self, y: f64) -> Matrix4x2<f64> {
        let nu = self.poisson_ratio;
        let w = Vector4::new(1.0, -1.0, 1.0, -1.0);
        let yw = Vector4::new(
            y,
            -y - (3.0 - 4.0 * nu),
            1.0 - 2.0 * nu + y,
            -(2.0 - 2.0 * nu) - y,
        );
        Matrix4x2::from_columns(&[w, yw])
    }

    fn half_space(&self) -> Matrix2<f64> {
        let (own, other) = (
            2.0 * (1.0 - self.poisson_ratio),
            1.0 - 2.0 * self.poisson_ratio,
        );
        Matrix2::new(own, other, other, own) / self.shear_modulus
    }

    /// e^(−y) exp(yM) = c₀ + c₁M + c₂M² + c₃M³, Hermite's interpolation of the exponential at the double eigenvalues ±1.
    fn transfer(&self, y: f64) -> Matrix4<f64> {
        let n = self.poisson_ratio / (1.0 - self.poisson_ratio);
        #[rustfmt::skip]
        let m = Matrix4::new(
            0.0, -n, 1.0 - n, 0.0,
            1.0, 0.0, 0.0, 2.0,
            0.0, 0.0, 0.0, -1.0,
            0.0, 1.0 + n, n, 0.0,
        );
        let decay = (-2.0 * y).exp();
        let (cosh, sinh) = (0.5 * (1.0 + decay), -0.5 * (-2.0 * y).exp_m1());
        let c3 = 0.5 * y_cosh_less_sinh(y, cosh, sinh);
        let c2 = 0.5 * y * sinh;
        let square = m * m;
        Matrix4::identity() * (cosh - c2) + m * (sinh - c3) + square * c2 + square * m * c3
    }
}

/// e^(−y) (y cosh y − sinh y), which is y³/3 where y is small and the terms cancel.
fn y_cosh_less_sinh(y: f64, cosh: f64, sinh: f64) -> f64 {
    if y > 0.5 {
        return y * cosh - sinh;
    }
    // Σ 2k y^(2k+1)/(2k+1)!; at y = ½ the first term left out is 10⁻¹⁷ of the sum.
    let square = y * y;
    let tail = 1.0 + square / 54.0 * (1.0 + square / 88.0 * (1.0 + square / 130.0));
    let series = 1.0 + square / 10.0 * (1.0 + square / 28.0 * tail);
    (-y).exp() * square * y / 3.0 * series
}

fn stacked(upper: Matrix2<f64>, lower: Matrix2<f64>) -> Matrix4x2<f64> {
    let mut rows = Matrix4x2::zeros();
    rows.fixed_rows_mut::<2>(0).copy_from(&upper);
    rows.fixed_rows_mut::<2>(2).copy_from(&lower);
    rows
}

/// Of tractions or conditions that belong to independent solutions: a load has one answer, so that the inverse exists.
fn inverse(matrix: Matrix2<f64>) -> Matrix2<f64> {
    matrix.try_inverse().unwrap_or_else(Matrix2::zeros)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(thickness: f64, shear_modulus: f64, poisson_ratio: f64) -> StackLayer {
        StackLayer {
            thickness,
            shear_modulus,
            poisson_ratio,
        }
    }

    /// 1 − L of one layer in closed form: with q = e^(−2s) bonded, k = 3 − 4ν, (2kq² + (1 + k² + 4s² + 4s)q)/(k(1 + q²) +
    /// (1 + k² + 4s²)q), free 2q(2s + 1 − q)/(1 − q² + 4sq).
    fn closed_form(s: f64, nu: f64, bond: Bond) -> f64 {
        let (k, q) = (3.0 - 4.0 * nu, (-2.0 * s).exp());
        let base = 1.0 + k * k + 4.0 * s * s;
        match bond {
            Bond::Bonded => {
                (2.0 * k * q * q + (base + 4.0 * s) * q) / (k * (1.0 + q * q) + base * q)
            }
            Bond::Free => 2.0 * q * (2.0 * s + 1.0 - q) / (1.0 - q * q + 4.0 * s * q),
        }
    }

    #[test]
    fn one_layer_has_its_closed_form_and_may_be_cut() {
        for nu in [-0.3, 0.0, 0.3, 0.4999, 0.5] {
            for bond in [Bond::Bonded, Bond::Free] {
                let one = Stack::new(vec![layer(1.0, 1.0, nu)], bond);
                let cut = [0.301, 0.001, 0.198, 0.5].map(|h| layer(h, 1.0, nu));
                let cut = Stack::new(cut.to_vec(), bond);
                for s in [0.01, 0.3, 0.99, 1.01, 4.0, 11.0, 25.0] {
                    let exact = closed_form(s, nu, bond);
                    let whole = one.deficit(s) / exact - 1.0;
                    assert!(whole.abs() < 1e-12, "{nu} {bond:?} {s}: {whole:e}");
                    // Thin layers are stiff: y = 10⁻⁵ takes some digits. A part's digits are those of what its lower face returns.
                    let parts = cut.deficit(s) - exact;
                    let tolerance = 1e-9 * exact + 1e-11 * (-2.0 * 0.301 * s).exp();
                    assert!(parts.abs() < tolerance, "{nu} {bond:?} {s}: {parts:e}");
                }
            }
        }
    }

    /// A long wave squeezes an incompressible bonded layer as lubrication theory says: W = k²h³p/(3G), so L = 2s³/3.
    #[test]
    fn long_waves_see_a_confined_layer() {
        let stack = Stack::new(vec![layer(1.0, 1.0, 0.5)], Bond::Bonded);
        for s in [0.01, 0.03] {
            let ratio = (1.0 - stack.deficit(s)) / (2.0 / 3.0 * s * s * s);
            assert!((ratio - 1.0).abs() < 3.0 * s * s, "{s}: {ratio}"); // the next order is s²
        }
    }

    #[test]
    fn short_waves_see_the_top_and_a_stiff_base_is_rigid() {
        let soft_below = [layer(0.2, 1.0, 0.45), layer(0.8, 0.1, 0.5)];
        let soft_below = Stack::new(soft_below.to_vec(), Bond::Bonded);
        assert!(soft_below.deficit(100.0).abs() < 1e-12);
        assert!(soft_below.deficit(1.0) < -0.1);
        let on_steel = [layer(0.2, 1.0, 0.45), layer(0.8, 1e9, 0.3)];
        let on_steel = Stack::new(on_steel.to_vec(), Bond::Bonded);
        for s in [2.0, 7.0, 60.0] {
            let thin = closed_form(s * 0.2, 0.45, Bond::Bonded);
            // Steel yields by 10⁻⁹ of the layer.
            assert!((on_steel.deficit(s) / thin - 1.0).abs() < 1e-7, "{s}");
        }
    }
}
