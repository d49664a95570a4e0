//! Refractive index as a function of wavelength, for PDMS and glass.

#[cfg(not(feature = "std"))]
use num_traits::Float;

use crate::error::{OpticsError, within};

/// A dispersion formula with the range of wavelengths of its fit. The unit of the wavelength λ in
/// the formulas is the micrometre.
///
/// ```
/// use tactile_optics::Dispersion;
///
/// // A user-defined material: Cauchy's formula through two measured indices.
/// let gel = Dispersion::Cauchy { coefficients: [1.40, 3.5e-3, 0.0], range_m: [0.45e-6, 0.65e-6] };
/// assert!((gel.index(0.5e-6_f64)? - 1.414).abs() < 1e-12);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Dispersion {
    /// Cauchy: n = a + b/λ² + c/λ⁴.
    Cauchy {
        /// a, b (µm²), c (µm⁴).
        coefficients: [f64; 3],
        /// Shortest and longest wavelength of the fit in metres.
        range_m: [f64; 2],
    },
    /// Sellmeier: n² = 1 + a + Σ Bₖ λ²/(λ² − Cₖ).
    Sellmeier {
        /// a, the strength of resonances far below the range.
        constant: f64,
        /// Strengths B and squared resonance wavelengths C (µm²).
        terms: [[f64; 2]; 3],
        /// Shortest and longest wavelength of the fit in metres.
        range_m: [f64; 2],
    },
}

impl Dispersion {
    /// PDMS (Dow Corning), 5 parts of base to 1 of curing agent: 1.4024 at 589 nm.
    ///
    /// Least-squares Cauchy fit by the authors of this crate to 36 tabulated values, 0.40–0.75 µm,
    /// with a residual sd of 1.8×10⁻⁴ and a maximum of 5.5×10⁻⁴ (X. Zhang et al., Appl. Opt. 59
    /// (2020) 2337–2344, as tabulated by refractiveindex.info).
    pub const PDMS_5_1: Self = Self::Cauchy {
        coefficients: [1.391435, 3.8065e-3, 0.0],
        range_m: [0.40e-6, 0.75e-6],
    };
    /// PDMS (Dow Corning), 10:1: 1.3950 at 589 nm, with a residual sd of 2.4×10⁻⁴ and a maximum of
    /// 4.6×10⁻⁴. For the source see [`PDMS_5_1`](Self::PDMS_5_1).
    pub const PDMS_10_1: Self = Self::Cauchy {
        coefficients: [1.384091, 3.7890e-3, 0.0],
        range_m: [0.40e-6, 0.75e-6],
    };
    /// PDMS (Dow Corning), 20:1: 1.4073 at 589 nm, with a residual sd of 1.6×10⁻⁴ and a maximum of
    /// 3.8×10⁻⁴. For the source see [`PDMS_5_1`](Self::PDMS_5_1).
    pub const PDMS_20_1: Self = Self::Cauchy {
        coefficients: [1.395397, 4.1179e-3, 0.0],
        range_m: [0.40e-6, 0.75e-6],
    };
    /// PDMS RTV 615: 1.4303 at 588 nm, 0.35–0.70 µm (F. Schneider et al., Sens. Actuators A 151
    /// (2009) 95–99).
    pub const PDMS_RTV615: Self = Self::Sellmeier {
        constant: 0.0,
        terms: [[1.0057, 0.013217], [0.0, 0.0], [0.0, 0.0]],
        range_m: [0.35e-6, 0.70e-6],
    };
    /// Borosilicate float glass BOROFLOAT 33: 1.4715 at 588 nm, 0.24–1.55 µm (Schott's data of June
    /// 2021, Sellmeier fit of refractiveindex.info).
    pub const BOROFLOAT_33: Self = Self::Sellmeier {
        constant: 0.3542,
        terms: [
            [0.78657, 0.10856 * 0.10856],
            [0.18285, 4.427 * 4.427],
            [0.0, 0.0],
        ],
        range_m: [0.24e-6, 1.55e-6],
    };
    /// Borosilicate crown glass N-BK7: 1.5168 at 588 nm, 0.3–2.5 µm (Schott's catalogue, 2017).
    pub const N_BK7: Self = Self::Sellmeier {
        constant: 0.0,
        terms: [
            [1.03961212, 0.00600069867],
            [0.231792344, 0.0200179144],
            [1.01046945, 103.560653],
        ],
        range_m: [0.3e-6, 2.5e-6],
    };

    /// The refractive index at a vacuum wavelength in metres.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a wavelength outside the range of the fit.
    ///
    /// ```
    /// use tactile_optics::Dispersion;
    /// assert!((Dispersion::N_BK7.index(587.6e-9_f64)? - 1.5168).abs() < 1e-5);
    /// // The range of the fit of PDMS ends at 750 nm.
    /// assert!(Dispersion::PDMS_10_1.index(850e-9_f64).is_err());
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn index(&self, wavelength_m: f64) -> Result<f64, OpticsError> {
        let [shortest, longest] = self.range_m();
        // A tolerance for wavelengths at the ends that are rounded.
        within(
            "wavelength in metres",
            wavelength_m,
            shortest * (1.0 - 1e-7),
            longest * (1.0 + 1e-7),
        )?;
        // λ² in µm², the unit of the published coefficients.
        let square = (wavelength_m * 1e6).powi(2);
        Ok(match self {
            Self::Cauchy {
                coefficients: [a, b, c],
                ..
            } => *a + (*b + *c / square) / square,
            Self::Sellmeier {
                constant, terms, ..
            } => {
                let mut n_squared = 1.0 + *constant;
                for &[strength, resonance] in terms {
                    n_squared += strength * square / (square - resonance);
                }
                n_squared.sqrt()
            }
        })
    }

    /// Shortest and longest wavelength of the fit in metres.
    fn range_m(&self) -> [f64; 2] {
        match self {
            Self::Cauchy { range_m, .. } | Self::Sellmeier { range_m, .. } => *range_m,
        }
    }
}
