//! Displacement and strain on a grid or at the points, as files for other programs.
use super::quantities;
use crate::failure::Failure;
use crate::outputs::Npz;
use nalgebra::{Matrix3, Point, SVector};
use tactile_imaging::PointGrid;
use tactile_imaging::elasticity::kinematics::StrainQuantities;

/// The fields of a grid in the legacy format of VTK, as text.
pub(super) fn vtk<const D: usize>(
    grid: &PointGrid<D>,
    found: &[Known<D>],
    read: &[StrainQuantities],
) -> Vec<u8> {
    let three = |v: &[f64]| {
        let at = |a: usize| v.get(a).copied().unwrap_or(0.0);
        format!("{:e} {:e} {:e}", at(0), at(1), at(2))
    };
    let counts: Vec<f64> = grid.counts.iter().map(|&c| c as f64).collect();
    let depth = if D == 2 { 1.0 } else { counts[D - 1] };
    let mut text = format!(
        "# vtk DataFile Version 3.0\ndisplacement and strain\nASCII\nDATASET \
             STRUCTURED_POINTS\nDIMENSIONS {} {} {depth}\nORIGIN {}\nSPACING {}\nPOINT_DATA {}\n",
        counts[0],
        counts[1],
        three(grid.origin.coords.as_slice()),
        three(&[grid.spacing; 3]),
        found.len()
    );
    text.push_str("VECTORS displacement double\n");
    for (displacement, ..) in found {
        text.push_str(&three(displacement.as_slice()));
        text.push('\n');
    }
    let strains: Vec<_> = found.iter().map(|at| at.1).collect();
    let errors: Vec<_> = found.iter().map(|at| at.2).collect();
    for (name, tensors) in [("strain", strains), ("standard_error", errors)] {
        text.push_str(&format!("TENSORS {name} double\n"));
        for tensor in tensors {
            // The tensors are symmetric, so that columns equal rows.
            for column in tensor.column_iter() {
                text.push_str(&three(&[column[0], column[1], column[2]]));
                text.push('\n');
            }
        }
    }
    quantities::vtk::<D>(&mut text, read);
    text.into_bytes()
}

/// Displacement, strain and its standard error at a point.
pub(super) type Known<const D: usize> = (SVector<f64, D>, Matrix3<f64>, Matrix3<f64>);

/// Adds points, displacements, strains and errors to arrays, with tensors of the plane or of space.
pub(super) fn arrays<const D: usize>(
    mut npz: Npz,
    shape: &[usize],
    points: &[Point<f64, D>],
    found: &[Known<D>],
    read: &[StrainQuantities],
) -> Result<Vec<u8>, Failure> {
    let vector = |v: SVector<f64, D>| <[f64; D]>::from(v).map(f64::to_le_bytes);
    let places = || (0..D).flat_map(|i| (0..D).map(move |j| (i, j)));
    let tensor = |m: Matrix3<f64>| places().map(move |at| m[at].to_le_bytes());
    let [vectors, tensors] = [&[D][..], &[D, D]].map(|axes| [shape, axes].concat());
    let points = points.iter().flat_map(|point| vector(point.coords));
    npz.add("points", "<f8", &vectors, points)?;
    let displacements = found.iter().flat_map(|at| vector(at.0));
    npz.add("displacement", "<f8", &vectors, displacements)?;
    let strains = found.iter().flat_map(|at| tensor(at.1));
    npz.add("strain", "<f8", &tensors, strains)?;
    let errors = found.iter().flat_map(|at| tensor(at.2));
    npz.add("standard_error", "<f8", &tensors, errors)?;
    quantities::arrays::<D>(&mut npz, shape, read)?;
    npz.into_bytes()
}
