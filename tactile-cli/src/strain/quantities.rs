//! Quantities of a deformation besides its strain, as columns, arrays and fields of a grid.
use crate::failure::Failure;
use crate::outputs::Npz;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use tactile_imaging::elasticity::kinematics::StrainQuantities;
use tactile_imaging::force::Estimate;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Name, value and standard error of a quantity at a point.
type Scalar = (String, f64, f64);

/// A quantity and its standard error.
type ValueAndError = fn(&StrainQuantities) -> [f64; 2];

/// The name of the area or volume ratio.
fn ratio<const D: usize>() -> &'static str {
    if D == 2 { "area_ratio" } else { "volume_ratio" }
}

/// The quantities without a direction.
fn scalars<const D: usize>(at: &StrainQuantities) -> Vec<Scalar> {
    let principal = (0..D).map(|k| {
        let name = format!("e_{}", k + 1);
        (name, at.principal[k], at.principal_error[k])
    });
    let first = [(
        "rotation_rad".to_owned(),
        at.rotation_rad,
        at.rotation_error_rad,
    )];
    let last = [
        (ratio::<D>().to_owned(), at.size_ratio, at.size_ratio_error),
        ("e_von_mises".to_owned(), at.equivalent, at.equivalent_error),
    ];
    first.into_iter().chain(principal).chain(last).collect()
}

fn entries<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|i| (0..D).map(move |j| (i, j)))
}

/// Headings of the columns: displacement gradient, scalars and principal directions, then their
/// standard errors. The error of a direction is that of its angle.
pub(super) fn headings<const D: usize>() -> Vec<String> {
    let gradient = entries::<D>().map(|(i, j)| format!("du{}_d{}", AXES[i], AXES[j]));
    let scalars = scalars::<D>(&StrainQuantities::undefined()).into_iter();
    let known: Vec<String> = gradient.chain(scalars.map(|scalar| scalar.0)).collect();
    let directions = (0..D).flat_map(|k| (0..D).map(move |i| format!("n{}_{}", k + 1, AXES[i])));
    let errors = known.iter().map(|name| format!("se_{name}"));
    let angles = (0..D).map(|k| format!("se_n{}_rad", k + 1));
    let all = known.iter().cloned().chain(directions);
    all.chain(errors).chain(angles).collect()
}

/// The cells below [`headings`].
pub(super) fn cells<const D: usize>(at: &StrainQuantities) -> Vec<f64> {
    let scalars = scalars::<D>(at);
    let mut row: Vec<f64> = entries::<D>().map(|place| at.gradient[place]).collect();
    row.extend(scalars.iter().map(|scalar| scalar.1));
    row.extend(entries::<D>().map(|(k, i)| at.directions[(i, k)]));
    row.extend(entries::<D>().map(|place| at.gradient_error[place]));
    row.extend(scalars.iter().map(|scalar| scalar.2));
    row.extend(&at.direction_error_rad[..D]);
    row
}

/// Arrays over all points, in this shape.
pub(super) fn arrays<const D: usize>(
    npz: &mut Npz,
    shape: &[usize],
    found: &[StrainQuantities],
) -> Result<(), Failure> {
    let tensors = [shape, &[D, D]].concat();
    let vectors = [shape, &[D]].concat();
    let tensor = |of: fn(&StrainQuantities, (usize, usize)) -> f64| {
        let places = found
            .iter()
            .flat_map(move |at| entries::<D>().map(move |place| of(at, place)));
        places.map(f64::to_le_bytes)
    };
    npz.add(
        "displacement_gradient",
        "<f8",
        &tensors,
        tensor(|at, place| at.gradient[place]),
    )?;
    let errors = tensor(|at, place| at.gradient_error[place]);
    npz.add("se_displacement_gradient", "<f8", &tensors, errors)?;
    // Row k of the array is direction k.
    let directions = tensor(|at, (k, i)| at.directions[(i, k)]);
    npz.add("principal_direction", "<f8", &tensors, directions)?;
    let vector = |of: fn(&StrainQuantities) -> [f64; 3]| {
        let places = found.iter().flat_map(move |at| of(at).into_iter().take(D));
        places.map(f64::to_le_bytes)
    };
    npz.add(
        "principal_strain",
        "<f8",
        &vectors,
        vector(|at| at.principal),
    )?;
    npz.add(
        "se_principal_strain",
        "<f8",
        &vectors,
        vector(|at| at.principal_error),
    )?;
    let angles = vector(|at| at.direction_error_rad);
    npz.add("se_principal_direction_rad", "<f8", &vectors, angles)?;
    let named: [(&str, ValueAndError); 3] = [
        ("rotation_rad", |at| {
            [at.rotation_rad, at.rotation_error_rad]
        }),
        (ratio::<D>(), |at| [at.size_ratio, at.size_ratio_error]),
        ("e_von_mises", |at| [at.equivalent, at.equivalent_error]),
    ];
    for (name, of) in named {
        let part = |k: usize| found.iter().map(move |at| of(at)[k].to_le_bytes());
        npz.add(name, "<f8", shape, part(0))?;
        npz.add(&format!("se_{name}"), "<f8", shape, part(1))?;
    }
    Ok(())
}

/// The fields of a grid in the legacy format of VTK.
pub(super) fn vtk<const D: usize>(text: &mut String, found: &[StrainQuantities]) {
    text.push_str("TENSORS displacement_gradient double\n");
    for at in found {
        for row in at.gradient.row_iter() {
            let _ = writeln!(text, "{:e} {:e} {:e}", row[0], row[1], row[2]);
        }
    }
    for k in 0..D {
        let _ = writeln!(text, "VECTORS principal_direction_{} double", k + 1);
        for at in found {
            let direction = at.directions.column(k);
            let _ = writeln!(
                text,
                "{:e} {:e} {:e}",
                direction[0], direction[1], direction[2]
            );
        }
    }
    let scalars: Vec<Vec<Scalar>> = found.iter().map(scalars::<D>).collect();
    for k in 0..scalars.first().map_or(0, Vec::len) {
        for error in [false, true] {
            let name = &scalars[0][k].0;
            let prefix = if error { "se_" } else { "" };
            let _ = writeln!(text, "SCALARS {prefix}{name} double\nLOOKUP_TABLE default");
            for place in &scalars {
                let value = if error { place[k].2 } else { place[k].1 };
                let _ = writeln!(text, "{value:e}");
            }
        }
    }
}

/// The median of every scalar over the points, and the median of its standard error.
pub(super) fn json<const D: usize>(found: &[StrainQuantities]) -> Value {
    let places: Vec<Vec<Scalar>> = found.iter().map(scalars::<D>).collect();
    let middle = |mut values: Vec<f64>| {
        values.retain(|value| !value.is_nan());
        values.sort_unstable_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let count = places.first().map_or(0, Vec::len);
    let medians: Map<String, Value> = (0..count)
        .map(|k| {
            let value = middle(places.iter().map(|place| place[k].1).collect());
            let error = middle(places.iter().map(|place| place[k].2).collect());
            (places[0][k].0.clone(), json!(Estimate::new(value, error)))
        })
        .collect();
    json!(medians)
}
