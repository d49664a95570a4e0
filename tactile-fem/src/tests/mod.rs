//! Convergence of the elements and of contact to exact solutions.

use crate::mesh::{Boundary, Mesh};
use crate::model::{ElementModel, Support};
use crate::spacing::{contact_lines, graded};
use crate::surface::RigidShape;
use crate::*;

mod contact;
mod elements;
mod phantoms;
mod press;
mod sparse;
mod squeeze;
mod stick;

/// A guide with one layer.
fn layer(thickness_m: f64, material: Material, radius_m: f64) -> Guide {
    let layer = GuideLayer {
        thickness_m,
        material,
    };
    Guide::new(vec![layer], radius_m).unwrap()
}

/// A ball on a guide, without friction.
fn ball_on_guide(radius_m: f64, material: Material, guide: &Guide) -> FemScene {
    let press = ObjectPress::new(ObjectShape::Ball { radius_m }, material).unwrap();
    press.on_guide(guide.clone()).unwrap().scene().unwrap()
}

/// Continues the lines of `inner` with those of `outer`.
fn continued(mut inner: Vec<f64>, outer: &[f64]) -> Vec<f64> {
    let end = inner[inner.len() - 1];
    inner.extend(outer.iter().skip(1).map(|r| end + r));
    inner
}
