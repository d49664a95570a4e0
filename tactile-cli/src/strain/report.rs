//! The strain between two sets of points as text, JSON, tables and a page of plots.
use crate::console::Console;
use crate::numbers::four_digits;
use crate::outputs::Csv;
use crate::plot::{Colour, Page, Panel};
use nalgebra::{Matrix3, Point};
use serde_json::{Map, Value, json};
use tactile_imaging::StrainBetween;
use tactile_imaging::pipeline::with_error;

/// Pairs of a smaller weight are left out of the spline.
const LEAST_WEIGHT: f64 = 1e-3;

/// The unit of points whose headings name one.
pub const METRES: &str = "m";

/// What was found, as far as it came.
pub struct Report<'a, const D: usize> {
    pub before: &'a [Point<f64, D>],
    pub after: &'a [Point<f64, D>],
    /// Pairs of the matcher.
    pub matched: &'a [(usize, usize)],
    pub strain: Result<StrainBetween<D>, String>,
    pub measure: &'static str,
    pub unit: &'static str,
}

/// Names and indices of the components in `D` dimensions.
fn components<const D: usize>() -> &'static [(&'static str, usize, usize)] {
    const ALL: [(&str, usize, usize); 6] = [
        ("e_xx", 0, 0),
        ("e_yy", 1, 1),
        ("e_xy", 0, 1),
        ("e_zz", 2, 2),
        ("e_xz", 0, 2),
        ("e_yz", 1, 2),
    ];
    &ALL[..if D == 2 { 3 } else { 6 }]
}

fn left_out<const D: usize>(found: &StrainBetween<D>) -> usize {
    found.weights.iter().filter(|w| **w < LEAST_WEIGHT).count()
}

impl<const D: usize> Report<'_, D> {
    /// The pairs that the strain comes from; those of the matcher where there is no strain.
    fn rows(&self) -> &[(usize, usize)] {
        match &self.strain {
            Ok(strain) => &strain.rows,
            Err(_) => self.matched,
        }
    }

    pub fn print(&self, console: &mut Console) {
        let pairs = self.rows().len();
        let share = |n: usize| 100.0 * pairs as f64 / n as f64;
        console.line(format!(
            "matched     {pairs} of {} points before ({:.1} %), of {} after ({:.1} %)",
            self.before.len(),
            share(self.before.len()),
            self.after.len(),
            share(self.after.len())
        ));
        match &self.strain {
            Ok(found) => print_strain(found, self.measure, self.unit, console),
            Err(reason) => console.line(format!("strain      none: {reason}")),
        }
    }

    pub fn json(&self) -> Value {
        let strain = match &self.strain {
            Ok(found) => json!({ "value": strain_json(found, self.measure) }),
            Err(reason) => json!({ "error": reason }),
        };
        json!({
            "points_before": self.before.len(), "points_after": self.after.len(),
            "unit": self.unit,
            "match": { "value": { "pairs": self.rows().len() } },
            "strain": strain,
        })
    }

    /// Rows (counted from 0), positions and displacements of the pairs, and their weights in the spline.
    pub fn pairs(&self) -> Vec<u8> {
        let axes = &["x", "y", "z"][..D];
        let suffix = suffix(self.unit);
        let mut header = vec!["row_before".to_owned(), "row_after".to_owned()];
        header.extend(axes.iter().map(|a| format!("{a}{suffix}")));
        header.extend(axes.iter().map(|a| format!("{a}_after{suffix}")));
        header.extend(axes.iter().map(|a| format!("u_{a}{suffix}")));
        header.push("weight".to_owned());
        let mut csv = Csv::new(&header);
        for (k, &(i, j)) in self.rows().iter().enumerate() {
            let (a, b) = (self.before[i], self.after[j]);
            let weight = match &self.strain {
                Ok(strain) => strain.weights[k],
                Err(_) => 1.0,
            };
            let mut row = vec![i as f64, j as f64];
            row.extend(a.iter().chain(b.iter()).chain((b - a).iter()));
            row.push(weight);
            csv.row(row);
        }
        csv.into_bytes()
    }
}

fn print_strain<const D: usize>(
    found: &StrainBetween<D>,
    measure: &str,
    unit: &str,
    console: &mut Console,
) {
    console.line(format!("left out    {} as misplaced", left_out(found)));
    console.line(format!(
        "noise       {} for each coordinate (in {unit})",
        four_digits(found.sigma)
    ));
    console.line(format!(
        "smoothing   {}",
        if found.relative_lambda >= 1e8 {
            "homogeneous (nothing finer is supported by the data)".into()
        } else {
            format!("λ = {:.0e} squared radii", found.relative_lambda)
        }
    ));
    let folded = found.summary.folded.len();
    if folded > 0 {
        console.line(format!(
            "FOLDED      at {folded} points (det F ≤ 0), left out of the mean"
        ));
    }
    console.line(format!(
        "\n{:<8} {:>26}   spread   ({measure} strain)",
        "", "mean"
    ));
    for &(name, i, j) in components::<D>() {
        let at = |m: &Matrix3<f64>| m[(i, j)];
        let mean = with_error(at(&found.summary.mean), at(&found.standard_error), 1.0);
        let spread = four_digits(at(&found.summary.spread));
        console.line(format!("{name:<8} {mean:>26}   {spread}"));
    }
    console.line(format!(
        "(standard errors with {} degrees of freedom)",
        found.degrees_of_freedom
    ));
}

fn strain_json<const D: usize>(found: &StrainBetween<D>, measure: &str) -> Value {
    let mut tensors = Map::new();
    for &(name, i, j) in components::<D>() {
        let value = json!({
            "mean": found.summary.mean[(i, j)],
            "spread": found.summary.spread[(i, j)],
            "standard_error": found.standard_error[(i, j)],
        });
        tensors.insert(name.to_owned(), value);
    }
    json!({
        "measure": measure,
        "left_out_as_misplaced": left_out(found),
        "noise_per_coordinate": found.sigma,
        "smoothing_over_squared_radius": found.relative_lambda,
        "degrees_of_freedom": found.degrees_of_freedom,
        "folded_points": found.summary.folded,
        "components": tensors,
    })
}

/// What a heading says of the unit; nothing where the points' own is not known.
fn suffix(unit: &str) -> &'static str {
    if unit == METRES { "_m" } else { "" }
}

/// The strain at every point, and its standard error.
pub fn strains<const D: usize>(found: &StrainBetween<D>, unit: &str) -> Vec<u8> {
    let suffix = suffix(unit);
    let mut header = vec!["row_before".to_owned()];
    header.extend(["x", "y", "z"][..D].iter().map(|a| format!("{a}{suffix}")));
    header.extend(components::<D>().iter().map(|c| c.0.to_owned()));
    header.extend(components::<D>().iter().map(|c| format!("se_{}", c.0)));
    let mut csv = Csv::new(&header);
    for (k, pair) in found.pairs.iter().enumerate() {
        let (strain, error) = (&found.strains[k], &found.standard_errors[k]);
        let mut row = vec![found.rows[k].0 as f64];
        row.extend(pair[0].iter());
        row.extend(components::<D>().iter().map(|c| strain[(c.1, c.2)]));
        row.extend(components::<D>().iter().map(|c| error[(c.1, c.2)]));
        csv.row(row);
    }
    csv.into_bytes()
}

pub fn page<const D: usize>(found: &StrainBetween<D>, unit: &str) -> Page {
    let flat = |p: &Point<f64, D>| [p[0], p[1]];
    let pairs = |kept: bool| {
        let chosen = (found.pairs.iter().zip(&found.weights))
            .filter(|(_, w)| (**w >= LEAST_WEIGHT) == kept)
            .map(|(pair, _)| [flat(&pair[0]), flat(&pair[1])]);
        chosen.collect::<Vec<_>>()
    };
    let panel = |title: String| {
        Panel::new(title)
            .x_label(format!("x ({unit})"))
            .y_label(format!("y ({unit})"))
            .equal_aspect()
    };
    let matches = panel("Displacements".into())
        .arrows(pairs(true), Colour::BLUE, "matched")
        .arrows(pairs(false), Colour::RED, "left out");
    let positions: Vec<_> = found.pairs.iter().map(|p| flat(&p[0])).collect();
    let shown = components::<D>().iter().filter(|c| c.1 == c.2 || D == 2);
    shown.fold(
        Page::new("Strain between two point sets")
            .columns(2)
            .panel(matches),
        |page, &(name, i, j)| {
            let at = (i, j);
            let mean = with_error(found.summary.mean[at], found.standard_error[at], 1.0);
            let values = found.strains.iter().map(|e| e[at]);
            page.panel(panel(format!("{name}: mean {mean}")).coloured_points(
                positions.clone(),
                values,
                name,
            ))
        },
    )
}
