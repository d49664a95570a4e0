//! Units in the headings of columns: `indentation_um`, `force (mN)`, `x [mm]`.
use super::error::ReadError;
use super::error::shorten;
use std::path::Path;

/// What a column measures, and so which units its heading may name.
///
/// Values are converted to SI: m, N, Pa and s. A unit of another quantity, or one that is not known, is an error and
/// never read as if it were SI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quantity {
    /// nm, um (µm), mm, cm, m.
    Length,
    /// nN, uN (µN), mN, N, kN.
    Force,
    /// Pa, kPa, MPa, GPa.
    Pressure,
    /// us (µs), ms, s.
    Time,
    /// A number without a unit. `px` and `grey_levels` may stand in the heading.
    Number,
}

/// The units of every quantity and their values in SI.
const UNITS: [(Quantity, &[(&str, f64)]); 5] = [
    (
        Quantity::Length,
        &[
            ("nm", 1e-9),
            ("um", 1e-6),
            ("mm", 1e-3),
            ("cm", 1e-2),
            ("m", 1.0),
        ],
    ),
    (
        Quantity::Force,
        &[
            ("nN", 1e-9),
            ("uN", 1e-6),
            ("mN", 1e-3),
            ("N", 1.0),
            ("kN", 1e3),
        ],
    ),
    (
        Quantity::Pressure,
        &[("Pa", 1.0), ("kPa", 1e3), ("MPa", 1e6), ("GPa", 1e9)],
    ),
    (Quantity::Time, &[("us", 1e-6), ("ms", 1e-3), ("s", 1.0)]),
    (
        Quantity::Number,
        &[("px", 1.0), ("grey_levels", 1.0), ("1", 1.0)],
    ),
];

impl Quantity {
    /// The value of one `unit` in SI. `None` where the quantity has no such unit. Both signs for micro are `u`.
    pub fn in_si(self, unit: &str) -> Option<f64> {
        let plain = unit.replace(['µ', 'μ'], "u");
        let units = UNITS.iter().find(|(quantity, _)| *quantity == self)?.1;
        let found = units.iter().find(|(name, _)| *name == plain)?;
        Some(found.1)
    }

    /// The quantity that `unit` measures. A number where none has it.
    pub fn of_unit(unit: &str) -> Self {
        let has = |quantity: &Self| quantity.in_si(unit).is_some();
        let mut quantities = UNITS.iter().map(|(quantity, _)| *quantity);
        quantities.find(has).unwrap_or(Self::Number)
    }

    /// The units that are known, for messages.
    fn known(self) -> String {
        let units = UNITS.iter().find(|(quantity, _)| *quantity == self);
        let names = units.map_or(&[][..], |u| u.1).iter().map(|u| u.0);
        names.collect::<Vec<_>>().join(", ")
    }
}

/// A heading cut into its name, in lower case, and its unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heading {
    pub name: String,
    pub unit: Option<String>,
}

impl Heading {
    pub fn parse(text: &str) -> Self {
        let text = text.trim();
        let bracketed = [('(', ')'), ('[', ']')]
            .into_iter()
            .find_map(|(open, close)| {
                let inside = text.strip_suffix(close)?;
                let (name, unit) = inside.rsplit_once(open)?;
                Some((name, unit.trim()))
            });
        let any_unit = |unit: &str| {
            UNITS
                .iter()
                .any(|(quantity, _)| quantity.in_si(unit).is_some())
        };
        let suffixed = || {
            let cuts = text.char_indices().filter(|(_, c)| matches!(c, '_' | ' '));
            let mut parts = cuts.map(|(i, _)| (&text[..i], &text[i + 1..]));
            parts.find(|(name, unit)| !name.is_empty() && any_unit(unit))
        };
        let (name, unit) = match bracketed.or_else(suffixed) {
            Some((name, unit)) => (name, Some(unit.to_owned())),
            None => (text, None),
        };
        let name = name.trim().trim_end_matches('_').to_lowercase();
        Self { name, unit }
    }

    /// The factor that takes the column's values to SI.
    pub fn factor(
        &self,
        quantity: Quantity,
        otherwise: &str,
        path: &Path,
    ) -> Result<f64, ReadError> {
        let unit = self.unit.as_deref().unwrap_or(otherwise);
        quantity.in_si(unit).ok_or_else(|| ReadError::Unit {
            path: path.into(),
            column: shorten(&self.name),
            known: quantity.known(),
            found: shorten(unit),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(text: &str) -> (String, Option<String>) {
        let heading = Heading::parse(text);
        (heading.name, heading.unit)
    }

    #[test]
    fn a_heading_is_cut_into_name_and_unit() {
        for (text, name, unit) in [
            ("indentation_um", "indentation", Some("um")),
            ("Force (mN)", "force", Some("mN")),
            ("x [µm]", "x", Some("µm")),
            ("depth mm", "depth", Some("mm")),
            ("darkness_grey_levels", "darkness", Some("grey_levels")),
            ("integrated_pixel_value", "integrated_pixel_value", None),
            ("force_gf", "force_gf", None),
            ("force (gf)", "force", Some("gf")),
            ("m", "m", None),
            ("", "", None),
        ] {
            assert_eq!(parts(text), (name.into(), unit.map(Into::into)), "{text}");
        }
    }

    #[test]
    fn an_unknown_unit_is_refused_and_named() {
        let error = Heading::parse("force (gf)").factor(Quantity::Force, "N", Path::new("a.csv"));
        assert_eq!(
            error.unwrap_err().to_string(),
            "a.csv: the column `force` is in `gf`, expected one of nN, uN, mN, N, kN"
        );
        let length = Heading::parse("force_mm").factor(Quantity::Force, "N", Path::new("a.csv"));
        assert!(matches!(length, Err(ReadError::Unit { .. })));
    }
}
