//! Finite-element results as states for the simulator.

use crate::contact::ContactState;
use crate::error::{SimulateError, at_least, positive};
use crate::materials::Elastic;
use tactile_imaging::fem::{AppliedLoad, FemScene, Interface, Material, State};

/// Poisson ratio used for ν = ½, which has no finite bulk modulus. With this value, the relative
/// volume change of a compressed block is (1 − 2ν) σ/E, 2e-4 of the stress over E.
const LARGEST_POISSON_RATIO: f64 = 0.4999;

impl ContactState {
    /// Converts a state that the finite-element solver found for a ball, a cone or another object
    /// with a free rim. `None` without contact.
    ///
    /// The samples are the nodes of the contact and its rim, where the pressure is 0.
    ///
    /// ```
    /// use tactile_imaging::fem::{AppliedLoad, Material, ObjectPress, ObjectShape};
    /// use tactile_simulate::ContactState;
    /// let ball = ObjectShape::Ball { radius_m: 3e-3 };
    /// let scene = ObjectPress::new(ball, Material::new(103e3, 0.49)?)?.scene()?;
    /// let solved = scene.solve(&[AppliedLoad::Force(0.2)]);
    /// let state = ContactState::from_solved(&solved.states[0]).expect("a contact");
    /// // Hertz: a³ = 3 F R (1 − ν²) / (4 E).
    /// assert!(
    ///     (state.contact_radius_m / 1.49e-3 - 1.0).abs() < 0.03,
    ///     "{}",
    ///     state.contact_radius_m
    /// );
    /// assert_eq!(state.pressure_pa.last(), Some(&0.0));
    /// # Ok::<(), tactile_imaging::elasticity::ElasticityError>(())
    /// ```
    pub fn from_solved(state: &State) -> Option<Self> {
        let contact_radius_m = state.contact_radius()?.radius_m;
        let approach_m = state.approach_m();
        let points = state.pressure();
        let mut contact = Self {
            force_n: state.force_n(),
            contact_radius_m,
            indentation_m: approach_m,
            radius_m: points.iter().map(|p| p.r_m).collect(),
            pressure_pa: points.iter().map(|p| p.pressure_pa).collect(),
            height_m: points.iter().map(|p| p.z_m - approach_m).collect(),
        };
        contact.radius_m.push(contact_radius_m);
        contact.pressure_pa.push(0.0);
        contact.height_m.push(*contact.height_m.last()?);
        Some(contact)
    }

    /// The face of a neo-Hookean cylinder compressed at finite strain between two rigid plates, on
    /// which its faces slide or to which they stick. Returns one state per force, for
    /// [`ContactModel::Tabulated`](crate::ContactModel::Tabulated). Each call solves all states
    /// again, at about 0.1 s each, so keep the result.
    ///
    /// With sliding faces the state is homogeneous, as in a [`UniaxialScene`](crate::UniaxialScene)
    /// apart from the material law. With sticking faces, the face keeps its size, and the pressure
    /// is higher in the middle of a flat cylinder and at the rim of a tall one. Blocks whose face
    /// is not a disc support only the homogeneous state.
    ///
    /// ```
    /// use tactile_imaging::fem::Interface;
    /// use tactile_simulate::{
    ///     Camera, ContactModel, ContactState, Elastic, PressLoad, PressOptions, PressScene,
    /// };
    /// let states = |faces| {
    ///     ContactState::of_squeezed_cylinder(6e-3, 6e-3, &Elastic::CL2000X, faces, &[0.5, 1.0])
    /// };
    /// let [sliding, sticking] = [states(Interface::Frictionless)?, states(Interface::Bonded)?];
    /// assert!(sliding[1].contact_radius_m > 6.2e-3 && sticking[1].contact_radius_m == 6e-3);
    /// let camera = Camera::default().coarser(8);
    /// let (law, loads) = (
    ///     ContactModel::Tabulated(sticking),
    ///     vec![PressLoad::normal(0.5), PressLoad::normal(1.0)],
    /// );
    /// let scene = PressScene::new(PressOptions {
    ///     law,
    ///     loads,
    ///     camera,
    ///     ..PressOptions::default()
    /// })?;
    /// assert_eq!(scene.frame(1, 0).dim(), (130, 174));
    /// # Ok::<(), tactile_simulate::SimulateError>(())
    /// ```
    ///
    /// # Errors
    /// [`SimulateError::OutOfRange`] for sizes, moduli and forces that are not positive or forces
    /// that do not increase, [`SimulateError::TooFew`] without a force, [`SimulateError::Overload`]
    /// for a force that the solver does not reach.
    pub fn of_squeezed_cylinder(
        radius_m: f64,
        height_m: f64,
        material: &Elastic,
        faces: Interface,
        forces_n: &[f64],
    ) -> Result<Vec<Self>, SimulateError> {
        positive("radius_m", radius_m)?;
        positive("height_m", height_m)?;
        material.validate()?;
        positive("youngs_modulus_pa", material.youngs_modulus_pa)?;
        at_least("forces_n", forces_n.len(), 1)?;
        let mut last_n = 0.0;
        for &force_n in forces_n {
            positive("the force in N", force_n - last_n)?;
            last_n = force_n;
        }
        let poisson_ratio = material.poisson_ratio.min(LARGEST_POISSON_RATIO);
        let unsolved = |limit_n: f64| SimulateError::Overload {
            force_n: last_n,
            limit_n,
        };
        let scene = Material::new(material.youngs_modulus_pa, poisson_ratio)
            .and_then(|material| {
                FemScene::cylinder_between_plates(radius_m, height_m, material, faces)
            })
            .map_err(|_| unsolved(0.0))?;
        let loads: Vec<AppliedLoad> = forces_n
            .iter()
            .map(|&force| AppliedLoad::Force(force))
            .collect();
        let states = scene.solve(&loads).states;
        if states.len() < forces_n.len() {
            return Err(unsolved(states.last().map_or(0.0, State::force_n)));
        }
        let of_state = |(state, &force_n): (&State, &f64)| Self {
            // The solver reaches the force within its tolerance.
            force_n,
            ..Self::of_face(state, radius_m, faces)
        };
        Ok(states.iter().zip(forces_n).map(of_state).collect())
    }

    /// The pressure on a face, from its middle to its rim.
    fn of_face(state: &State, undeformed_m: f64, faces: Interface) -> Self {
        let points = state.pressure();
        let force_n = state.force_n();
        let middle_pa = points.first().map_or(0.0, |point| point.pressure_pa);
        let rim_pa = points.last().map_or(0.0, |point| point.pressure_pa);
        let rim_m = match faces {
            Interface::Bonded => undeformed_m,
            // The pressure is uniform.
            Interface::Frictionless => (force_n / (std::f64::consts::PI * middle_pa)).sqrt(),
        };
        let mut radius_m = vec![0.0];
        let mut pressure_pa = vec![middle_pa];
        for point in points {
            radius_m.push(point.r_m);
            // A contact state has no tension, and negative pressures would be rejected.
            pressure_pa.push(point.pressure_pa.max(0.0));
        }
        radius_m.push(rim_m);
        pressure_pa.push(rim_pa.max(0.0));
        Self {
            force_n,
            contact_radius_m: rim_m,
            // The other half is compressed equally.
            indentation_m: 2.0 * state.approach_m(),
            height_m: vec![0.0; radius_m.len()],
            radius_m,
            pressure_pa,
        }
    }
}
