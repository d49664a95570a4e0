//! The curve and the indenter that the arguments describe.
use super::{Arguments, Law, Shape};
use crate::failure::Failure;
use clap::ValueEnum;
use tactile_imaging::elasticity::contact::{Bond, relative_radius_m, tangent_of_degrees};
use tactile_imaging::elasticity::curve::{IndentationCurve, Indenter, Model};
use tactile_imaging::elasticity::modulus::EstimatorKind;
use tactile_imaging::io::{Column, Quantity, read_table};

impl Arguments {
    /// Refuses options that do not apply to what is pressed by what.
    pub fn check(&self) -> Result<(), Failure> {
        let (shape, ball) = (self.shape, self.ball_radius.is_some());
        let sphere = shape == Shape::Sphere;
        let with = |wrong: bool, option: &str, reason: &str| {
            let shape = shape.name();
            wrong.then(|| {
                Failure::input(format!(
                    "{option} does not apply to --shape {shape}{reason}: leave it out"
                ))
            })
        };
        let layer = self.thickness.is_some();
        let both = ball && self.radius.is_some();
        let wrong = [
            with(
                self.on_plate && !both,
                "--on-plate",
                " without --radius and --ball-radius",
            ),
            with(
                self.radius.is_some() && shape == Shape::Cone,
                "--radius",
                "",
            ),
            with(
                self.half_angle.is_some() && shape != Shape::Cone,
                "--half-angle",
                "",
            ),
            with(ball && !sphere, "--ball-radius", ""),
            with(layer && !sphere, "--thickness", ""),
            with(layer && ball, "--thickness", " with --ball-radius"),
            with(self.sliding && !layer, "--sliding", " without --thickness"),
            with(self.plates && !ball, "--plates", " without --ball-radius"),
            with(self.no_slip && layer, "--no-slip", " with --thickness"),
            with(
                self.no_slip && self.on_plate,
                "--no-slip",
                " with --on-plate",
            ),
            with(
                self.no_slip && ball && self.radius.is_none(),
                "--no-slip",
                " with --ball-radius alone",
            ),
            with(
                self.plates && self.radius.is_some(),
                "--plates",
                " with --radius",
            ),
        ];
        if let Some(failure) = wrong.into_iter().flatten().next() {
            return Err(failure);
        }
        if let Some(needs) = self.law_needs() {
            return Err(Failure::input(format!(
                "--model {} is a law for {needs}: leave it out, or name another",
                self.model
                    .to_possible_value()
                    .as_ref()
                    .map_or("", |v| v.get_name())
            )));
        }
        match shape {
            Shape::Punch if self.radius.is_none() => {
                Err(Failure::input("--shape punch needs --radius, in m"))
            }
            Shape::Sphere if self.radius.is_none() && !ball => Err(Failure::input(
                "--shape sphere needs --radius of the sphere or --ball-radius of the sample, in m",
            )),
            _ => Ok(()),
        }
    }

    /// What the asked law is for, where that is not what is pressed.
    fn law_needs(&self) -> Option<&'static str> {
        let sphere = self.shape == Shape::Sphere;
        let (fits, needs) = match self.model {
            Law::Auto => return None,
            Law::Hertz => (
                sphere && !self.on_plate,
                "--shape sphere without --on-plate",
            ),
            Law::Layer | Law::LayerSeries | Law::LayerPublished => (
                sphere && self.thickness.is_some(),
                "--shape sphere with --thickness",
            ),
            Law::Ball | Law::Tatara => (
                sphere && self.ball_radius.is_some() && self.radius.is_none(),
                "--shape sphere with --ball-radius alone",
            ),
            Law::Punch => (self.shape == Shape::Punch, "--shape punch"),
            Law::Cone => (self.shape == Shape::Cone, "--shape cone"),
        };
        (!fits).then_some(needs)
    }

    pub fn indenter(&self) -> Result<Indenter, tactile_imaging::elasticity::ElasticityError> {
        let bond = if self.sliding {
            Bond::Free
        } else {
            Bond::Bonded
        };
        Ok(match (self.shape, self.radius, self.ball_radius) {
            (Shape::Cone, ..) => Indenter::Cone {
                half_angle_tangent: tangent_of_degrees(self.half_angle.unwrap_or(70.3))?,
            },
            (Shape::Punch, radius, _) => Indenter::Punch {
                radius_m: radius.unwrap_or_default(),
            },
            (Shape::Sphere, None, Some(radius_m)) => Indenter::Ball { radius_m },
            (Shape::Sphere, Some(tip_radius_m), Some(ball_radius_m)) if self.on_plate => {
                Indenter::TipOnBall {
                    tip_radius_m,
                    ball_radius_m,
                }
            }
            (Shape::Sphere, radius, ball) => Indenter::Sphere {
                radius_m: relative_radius_m(radius, ball)?,
                thickness_m: self.thickness,
                bond,
            },
        })
    }

    pub fn model(&self) -> Model {
        use EstimatorKind as K;
        if self.no_slip {
            return Model::Named(match self.shape {
                Shape::Sphere => K::SphereWithoutSlip,
                Shape::Punch => K::FlatPunchWithoutSlip,
                Shape::Cone => K::ConeWithoutSlip,
            });
        }
        Model::Named(match self.model {
            Law::Auto => return Model::Auto,
            Law::Hertz => K::HertzSphere,
            Law::Layer => K::LayerIntegralEquation,
            Law::LayerSeries => K::LayerCorrectedSeries,
            Law::LayerPublished => K::LayerPublishedSeries,
            Law::Ball => K::SphereOnFlat,
            Law::Tatara => K::TataraSphere,
            Law::Punch => K::FlatPunch,
            Law::Cone => K::Cone,
        })
    }

    pub fn read(&self) -> Result<IndentationCurve, Failure> {
        let table = read_table(&self.curve)?;
        let indentation = Column {
            names: &["indentation", "depth", "position", "displacement"],
            quantity: Quantity::Length,
            unit: "m",
        };
        let force = Column {
            names: &["force", "load"],
            quantity: Quantity::Force,
            unit: "N",
        };
        if self.force_first && !table.header.is_empty() {
            return Err(Failure::input(format!(
                "--force-first is for tables without a header, and {} has one: leave it out",
                self.curve.display()
            )));
        }
        let [mut z, f] = if self.force_first {
            let [f, z] = table.columns([force, indentation], &self.curve)?;
            [z, f]
        } else {
            table.columns([indentation, force], &self.curve)?
        };
        if self.plates {
            z.iter_mut().for_each(|z| *z *= 0.5);
        }
        IndentationCurve::new(&z, &f)
            .map_err(|error| Failure::input(format!("{}: {error}", self.curve.display())))
    }
}
