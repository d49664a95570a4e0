//! Convergence of the elements and of contact, against exact solutions.

use crate::mesh::{Boundary, Mesh, contact_lines, graded};
use crate::model::{ElementModel, RigidShape, Support};
use crate::*;

mod contact;
mod elements;
mod indentation;
mod press;
mod sparse;
mod squeeze;
mod stick;
mod vtk;
