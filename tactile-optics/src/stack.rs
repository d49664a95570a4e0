//! A stack of plane layers in its ambient.

use crate::angle::{AcceptanceAngle, acceptance_angle};
use crate::error::OpticsError;
use crate::real::{Real, index, real, within};

/// A stack of plane layers with the same ambient on both sides, given by the refractive indices from the object's side to
/// the glass. It borrows the indices: construction costs their check and nothing else.
///
/// Critical and propagation angles are per layer: call [`critical_angle`](crate::critical_angle) or
/// [`propagation`](crate::propagation) on the index wanted.
///
/// ```
/// use tactile_optics::LayerStack;
/// let stack = LayerStack::new(&[1.38_f64, 1.39, 1.40, 1.41], 1.0)?;
/// // The LED's cone must stay under 143.96° (143.9789 untruncated), the weakest layer's.
/// assert!(stack.led_cone(140.0_f64.to_radians())?.is_trapped());
/// assert!(!stack.led_cone(150.0_f64.to_radians())?.is_trapped());
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerStack<'a, T> {
    indices: &'a [T],
    ambient: T,
}

/// Transmittance and reflectance of a lossless stack at normal incidence.
///
/// ```
/// use tactile_optics::LayerStack;
///
/// // A pane of glass: 4 % at each face; the light between the faces adds a little.
/// let pane = LayerStack::new(&[1.5_f64], 1.0)?.normal_incidence();
/// assert!((pane.single_pass - 0.96 * 0.96).abs() < 1e-15);
/// assert!((pane.transmittance - 12.0 / 13.0).abs() < 1e-15);
/// assert!((pane.transmittance + pane.reflectance - 1.0).abs() < 1e-15);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalIncidence<T> {
    /// Transmittance if what is reflected once is lost, Π(1 − Rⱼ).
    pub single_pass: T,
    /// Transmittance with all reflections added by intensity, 1/(1 + Σ Rⱼ/(1 − Rⱼ)).
    pub transmittance: T,
    /// Reflectance with all reflections added by intensity, 1 − transmittance.
    pub reflectance: T,
}

/// The comparison of an LED's cone of light with the acceptance angles of a stack.
///
/// ```
/// use tactile_optics::LayerStack;
///
/// let cone = LayerStack::new(&[1.38_f64, 1.41], 1.0)?.led_cone(150.0_f64.to_radians())?;
/// assert!(!cone.is_trapped());
/// // Six degrees too wide for the layer of 1.38.
/// assert!((cone.margin.to_degrees() + 6.0211).abs() < 1e-4);
/// # Ok::<(), tactile_optics::OpticsError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LedCone<T> {
    /// Full angle of the LED's cone in radians.
    pub full_angle: T,
    /// The smallest acceptance angle of the layers.
    pub weakest: AcceptanceAngle<T>,
    /// The largest full angle trapped, twice the weakest layer's acceptance angle, less the cone's. Negative: that much
    /// too wide. A cone of less than π inside a stack that traps every ray has at least π less its own angle.
    pub margin: T,
}

impl<T: Real> LedCone<T> {
    /// Whether every ray of the cone is trapped.
    pub fn is_trapped(&self) -> bool {
        match self.weakest {
            AcceptanceAngle::NoneTrapped => false,
            AcceptanceAngle::AllTrapped => true,
            AcceptanceAngle::Below(_) => self.margin > T::zero(),
        }
    }
}

impl<'a, T: Real> LayerStack<'a, T> {
    /// Layers of the given indices in an ambient.
    ///
    /// # Errors
    /// [`OpticsError::Empty`] without layers, [`OpticsError::OutOfRange`] for an index that is not positive and finite.
    pub fn new(indices: &'a [T], ambient: T) -> Result<Self, OpticsError> {
        if indices.is_empty() {
            return Err(OpticsError::Empty {
                quantity: "stack of layers",
            });
        }
        for &n in indices {
            index(n)?;
        }
        Ok(Self {
            indices,
            ambient: index(ambient)?,
        })
    }

    /// The acceptance angle of each layer in the ambient, (1)–(4).
    ///
    /// ```
    /// use tactile_optics::LayerStack;
    ///
    /// let stack = LayerStack::new(&[1.38_f64, 1.39, 1.40, 1.41], 1.0)?;
    /// let degrees: Vec<_> = stack.acceptance_angles().map(|a| a.radians().to_degrees()).collect();
    /// // The paper prints them truncated: 71.98, 74.89, 78.46 and 83.73.
    /// assert!((degrees[0] - 71.98).abs() < 0.01 && (degrees[3] - 83.73).abs() < 0.01);
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn acceptance_angles(&self) -> impl Iterator<Item = AcceptanceAngle<T>> + 'a {
        let ambient = self.ambient;
        self.indices
            .iter()
            .map(move |&n| acceptance_angle(n, ambient).unwrap_or(AcceptanceAngle::NoneTrapped))
    }

    /// Transmittance and reflectance at normal incidence, ambient to ambient, without interference.
    ///
    /// Rⱼ/(1 − Rⱼ) = (a − b)²/(4ab) and 1 − Rⱼ = 4ab/(a + b)² at the interface of indices a and b. O(layers).
    ///
    /// ```
    /// use tactile_optics::LayerStack;
    ///
    /// // An index between the ambient's and the layer's on both faces halves the loss.
    /// let bare = LayerStack::new(&[1.5_f64], 1.0)?.normal_incidence();
    /// let coated = LayerStack::new(&[1.5_f64.sqrt(), 1.5, 1.5_f64.sqrt()], 1.0)?.normal_incidence();
    /// assert!(coated.reflectance < 0.55 * bare.reflectance);
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn normal_incidence(&self) -> NormalIncidence<T> {
        let four = real::<T>(4.0);
        let (mut single_pass, mut reflected) = (T::one(), T::zero());
        let mut before = self.ambient;
        for after in self
            .indices
            .iter()
            .copied()
            .chain(core::iter::once(self.ambient))
        {
            let (sum, step) = (before + after, before - after);
            single_pass = single_pass * (four * (before / sum) * (after / sum));
            reflected = reflected + step / before * (step / after) / four;
            before = after;
        }
        let transmittance = (T::one() + reflected).recip();
        NormalIncidence {
            single_pass,
            transmittance,
            reflectance: reflected / (T::one() + reflected),
        }
    }

    /// Whether the cone of an LED at the stack's edge is trapped by every layer: it must stay under 2·min θᵢ.
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for a full angle outside 0 to π.
    pub fn led_cone(&self, full_angle: T) -> Result<LedCone<T>, OpticsError> {
        within(
            "full angle of the cone",
            full_angle,
            0.0,
            core::f64::consts::PI * (1.0 + 1e-7),
        )?;
        let mut weakest = AcceptanceAngle::AllTrapped;
        for answer in self.acceptance_angles() {
            if answer.radians() < weakest.radians() {
                weakest = answer;
            }
        }
        let limit = weakest.radians() + weakest.radians();
        Ok(LedCone {
            full_angle,
            weakest,
            margin: limit - full_angle,
        })
    }
}
