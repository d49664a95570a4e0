//! A stack of layers in its ambient.

use crate::angle::{AcceptanceAngle, CriticalAngle, acceptance_angle, critical_angle};
use crate::error::OpticsError;
use crate::real::{Real, index, real, within};
use crate::snell::{Propagation, propagation};

/// Refractive indices of any number of plane layers, with the same ambient on both sides. It borrows: making one costs
/// the check of the indices and nothing else.
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

/// What a stack does to light that falls on it at right angles; lossless.
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
    /// The rest: reflectance with all reflections added by intensity.
    pub reflectance: T,
}

/// Whether an LED's cone of light is trapped by the whole stack.
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
    /// The weakest layer's answer.
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

    /// The layers' indices.
    ///
    /// ```
    /// use tactile_optics::LayerStack;
    ///
    /// let stack = LayerStack::new(&[1.38_f64, 1.41], 1.0)?;
    /// assert_eq!((stack.indices(), stack.ambient()), (&[1.38, 1.41][..], 1.0));
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn indices(&self) -> &'a [T] {
        self.indices
    }

    /// The ambient's index.
    pub fn ambient(&self) -> T {
        self.ambient
    }

    /// The critical angle of each layer against the ambient.
    ///
    /// ```
    /// use tactile_optics::{CriticalAngle, LayerStack};
    ///
    /// let stack = LayerStack::new(&[1.38_f64, 0.9], 1.0)?;
    /// let answers: Vec<_> = stack.critical_angles().collect();
    /// assert!(matches!(answers[0], CriticalAngle::Beyond(angle) if (angle.degrees() - 46.4387).abs() < 1e-4));
    /// assert_eq!(answers[1], CriticalAngle::Never);
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn critical_angles(&self) -> impl Iterator<Item = CriticalAngle<T>> + 'a {
        let ambient = self.ambient;
        self.indices
            .iter()
            .map(move |&n| critical_angle(n, ambient).unwrap_or(CriticalAngle::Never))
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

    /// The angle in each layer of light with the invariant n sin θ (for light entering from the ambient at θ₀ through
    /// the top or bottom face: n₀ sin θ₀).
    ///
    /// # Errors
    /// [`OpticsError::OutOfRange`] for an invariant that is negative or not finite.
    ///
    /// ```
    /// use tactile_optics::{LayerStack, Propagation};
    ///
    /// // Light that entered from air at 60° is steeper the denser the layer.
    /// let stack = LayerStack::new(&[1.38_f64, 1.41], 1.0)?;
    /// let cosines: Vec<_> = stack
    ///     .propagation(60.0_f64.to_radians().sin())?
    ///     .map(|p| if let Propagation::At { cosine, .. } = p { cosine } else { 0.0 })
    ///     .collect();
    /// assert!(0.5 < cosines[0] && cosines[0] < cosines[1]);
    /// # Ok::<(), tactile_optics::OpticsError>(())
    /// ```
    pub fn propagation(
        &self,
        invariant: T,
    ) -> Result<impl Iterator<Item = Propagation<T>> + 'a, OpticsError> {
        within("invariant n sin θ", invariant, 0.0, f64::MAX)?;
        let in_layer = move |&n| propagation(n, invariant).unwrap_or(Propagation::Evanescent);
        Ok(self.indices.iter().map(in_layer))
    }

    /// Light through the whole stack at right angles, ambient to ambient, with no interference.
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
        let weaker = |a: AcceptanceAngle<T>, b| {
            if a.radians() <= AcceptanceAngle::radians(&b) {
                a
            } else {
                b
            }
        };
        let weakest = self
            .acceptance_angles()
            .fold(AcceptanceAngle::AllTrapped, weaker);
        let limit = weakest.radians() + weakest.radians();
        Ok(LedCone {
            full_angle,
            weakest,
            margin: limit - full_angle,
        })
    }
}
