//! The image references: numbers of 60 digits and more, in `../shared/data/reference/image.json` or under `TACTILE_DATA`.
#![allow(clippy::print_stdout)]

use ndarray::Array2;
use serde_json::Value;
use tactile_force::{GaussianProfile, HertzProfile, ImageMoments, PixelGrid, ProfileMoments};

const EPS: f64 = f64::EPSILON;

fn load() -> Option<Value> {
    let folder = std::env::var("TACTILE_DATA")
        .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data").into());
    let text =
        std::fs::read_to_string(std::path::Path::new(&folder).join("reference/image.json")).ok()?;
    let data: Value = serde_json::from_str(&text).expect("valid JSON");
    for check in data["header"]["parse_check"].as_array().unwrap() {
        let bits = u64::from_str_radix(&check["bits"].as_str().unwrap()[2..], 16).unwrap();
        assert_eq!(
            check["value"].as_f64().unwrap().to_bits(),
            bits,
            "numbers must be read exactly"
        );
    }
    Some(data)
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("a number, found {value}"))
}

fn image(value: &Value) -> Option<Array2<f64>> {
    let rows = value.as_array()?;
    let flat: Vec<f64> = rows
        .iter()
        .flat_map(|r| r.as_array().unwrap())
        .map(number)
        .collect();
    Some(Array2::from_shape_vec((rows.len(), flat.len() / rows.len()), flat).unwrap())
}

type Condition = Box<dyn Fn(f64, f64) -> f64>;

/// Checks one number and keeps the worst ratio of error to allowance.
struct Score {
    worst: (f64, String),
    failed: Vec<String>,
}

impl Score {
    fn check(&mut self, what: String, found: f64, expected: f64, allowed: f64) {
        let ratio = (found - expected).abs() / allowed;
        if ratio.is_nan() || ratio > 1.0 {
            self.failed.push(format!(
                "{what}: found {found:e}, expected {expected:e}, {ratio:.2} of the allowance"
            ));
        }
        if ratio > self.worst.0 {
            self.worst = (ratio, what);
        }
    }

    fn relative(&mut self, what: String, found: f64, expected: f64, condition: f64) {
        self.check(
            what,
            found,
            expected,
            f64::max(1e-13, 10.0 * EPS * condition) * expected.abs() + f64::MIN_POSITIVE,
        );
    }
}

/// An image and what its moments should be.
struct Moments<'a> {
    id: &'a str,
    pixels: &'a Array2<f64>,
    background: f64,
    pitch: f64,
    expected: &'a Value,
    /// The pixels are rounded results themselves, and carry eps each.
    rounded: bool,
}

impl Moments<'_> {
    /// Conditions of the moments of an image whose pixels are exact: 1 for a sum of one sign, else Σ|d|/|Σd| over what double-double
    /// arithmetic has to spare. The variance's and centroid's inputs are exact, too.
    fn check(&self, score: &mut Score) {
        let m = ImageMoments::of(self.pixels.view(), self.background).unwrap();
        let d = self.pixels.mapv(|p| p - self.background);
        let condition = if self.rounded {
            d.mapv(f64::abs).sum() / d.sum().abs()
        } else {
            1.0
        };
        self.relative(score, "sum", m.sum, condition);
        self.relative(score, "force", m.sum * self.pitch * self.pitch, condition);
        self.relative(score, "min", m.least, 1.0);
        self.relative(score, "max", m.greatest, 1.0);
        // An alternating image of 1e16 has a mean of 9: the condition of the mean of exact pixels is 1 in double-double.
        self.relative(score, "mean", m.mean, condition);
        self.variance(score, &m);
        let status = match (m.centroid_px, m.radius_of_gyration_px) {
            (None, _) => "empty",
            (Some(_), None) => "negative_second_moment",
            (Some(_), Some(_)) => "ok",
        };
        assert_eq!(
            status,
            self.expected["status"].as_str().unwrap(),
            "{}",
            self.id
        );
        self.place(score, &m, condition);
    }

    fn relative(&self, score: &mut Score, key: &str, found: f64, condition: f64) {
        if !self.expected[key].is_null() {
            score.relative(
                format!("{} {key}", self.id),
                found,
                number(&self.expected[key]),
                condition,
            );
        }
    }

    fn variance(&self, score: &mut Score, m: &ImageMoments<f64>) {
        if number(&self.expected.get("variance").cloned().unwrap_or(0.0.into())) == 0.0 {
            assert!(
                m.variance == 0.0,
                "{}: variance of equal pixels {}",
                self.id,
                m.variance
            );
        } else {
            let scale = m.greatest.abs().max(m.least.abs());
            let condition = if self.rounded {
                scale * scale / m.variance
            } else {
                1.0
            };
            self.relative(score, "variance", m.variance, condition);
        }
    }

    /// Centroid and radius of gyration.
    fn place(&self, score: &mut Score, m: &ImageMoments<f64>, condition: f64) {
        let (id, expected, pitch) = (self.id, self.expected, self.pitch);
        assert_eq!(
            m.centroid_px.is_none(),
            expected["centroid"].is_null(),
            "{id}"
        );
        if let (Some(c), Some(e)) = (m.centroid_px, expected["centroid"].as_array()) {
            for (k, axis) in ["x", "y"].iter().enumerate() {
                let what = format!("{id} centroid {axis}");
                score.relative(what, (c[k] + 0.5) * pitch, number(&e[k]), condition);
            }
        }
        if let (Some(r), Some(e)) = (
            m.radius_of_gyration_px,
            expected["radius_of_gyration"].as_f64(),
        ) {
            if e == 0.0 {
                assert_eq!(r, 0.0, "{id}")
            } else {
                score.relative(format!("{id} gyration"), r * pitch, e, condition)
            }
        }
    }
}

/// Distances from the centre are rounded when the centre is subtracted: cond = position over distance to what matters.
fn profile(
    score: &mut Score,
    id: &str,
    found: Option<ProfileMoments<f64>>,
    expected: &Value,
    condition: f64,
) {
    assert_eq!(found.is_none(), expected.is_null(), "{id}");
    let Some(m) = found else { return };
    score.relative(
        format!("{id} integral"),
        m.integral,
        number(&expected["force"]),
        condition,
    );
    for k in 0..2 {
        score.relative(
            format!("{id} centroid {k}"),
            m.centroid[k],
            number(&expected["centroid"][k]),
            condition,
        );
    }
    score.relative(
        format!("{id} gyration"),
        m.radius_of_gyration,
        number(&expected["radius_of_gyration"]),
        condition,
    );
}

/// A blob of light: its image, its moments over the plane and over the frame, and the condition of a pixel.
struct Blob {
    pixels: Array2<f64>,
    whole: ProfileMoments<f64>,
    within: Option<ProfileMoments<f64>>,
    condition: Condition,
}

impl Blob {
    fn of(case: &Value, size: usize, pitch: f64, centre: [f64; 2]) -> Self {
        let p = &case["params"];
        let peak = number(&p["amplitude"]);
        let grid = PixelGrid {
            rows: size,
            columns: size,
            size: [pitch; 2],
            first: [0.5 * pitch; 2],
        };
        let side = [0.0, size as f64 * pitch];
        let frame = [side, side];
        if case["kind"] == "gaussian" {
            let sd = number(&p["sigma"]);
            let blob = GaussianProfile::new(centre, sd, peak).unwrap();
            let condition = gaussian_condition(centre, sd);
            Self {
                pixels: blob.image(&grid),
                whole: blob.whole(),
                within: blob.within(frame),
                condition,
            }
        } else {
            let a = number(&p["a"]);
            let blob = HertzProfile::new(centre, a, peak).unwrap();
            let condition = hertz_condition(centre, a, pitch);
            Self {
                pixels: blob.image(&grid),
                whole: blob.whole(),
                within: blob.within(frame),
                condition,
            }
        }
    }
}

/// d ln g / d ln x = x (x − c)/σ²: rounding of a position, magnified.
fn gaussian_condition(centre: [f64; 2], sd: f64) -> Condition {
    Box::new(move |x: f64, y: f64| {
        let along = |x: f64, c: f64| (x.abs() + c.abs()) * (x - c).abs() / (sd * sd);
        1.0 + along(x, centre[0]) + along(y, centre[1])
    })
}

/// A pixel cut by the edge down to a depth d (of its farthest corner inside) changes as d^1.5 or faster.
fn hertz_condition(centre: [f64; 2], a: f64, pitch: f64) -> Condition {
    Box::new(move |x: f64, y: f64| {
        let far = |x: f64, c: f64| ((x - c).abs() - 0.5 * pitch).max(0.0);
        let depth = (a - far(x, centre[0]).hypot(far(y, centre[1]))).max(0.0);
        let reach = x.abs() + y.abs() + centre[0].abs() + centre[1].abs() + pitch;
        1.0 + 3.0 * reach / depth.min(a).min(pitch)
    })
}

/// Every pixel of a blob against the reference's.
fn check_pixels(score: &mut Score, id: &str, blob: &Blob, reference: &Array2<f64>, pitch: f64) {
    for ((row, column), &e) in reference.indexed_iter() {
        let (x, y) = ((column as f64 + 0.5) * pitch, (row as f64 + 0.5) * pitch);
        let what = format!("{id} pixel {row} {column}");
        if e == 0.0 {
            assert_eq!(blob.pixels[[row, column]], 0.0, "{what} lies outside");
            continue;
        }
        score.relative(what, blob.pixels[[row, column]], e, (blob.condition)(x, y));
    }
}

fn check_blob(score: &mut Score, case: &Value, id: &str, pitch: f64) {
    let (size, expected) = (case["size"].as_u64().unwrap() as usize, &case["expected"]);
    let centre = ["cx", "cy"].map(|c| number(&case["params"][c]));
    let blob = Blob::of(case, size, pitch, centre);
    profile(
        score,
        &format!("{id} plane"),
        Some(blob.whole),
        &expected["plane"],
        1.0,
    );
    let [x, y] = centre.map(|c| 0.0_f64.max(c.min(size as f64 * pitch)));
    profile(
        score,
        &format!("{id} frame"),
        blob.within,
        &expected["frame"],
        (blob.condition)(x, y),
    );
    let reference = image(&expected["pixels"]);
    match &reference {
        None => assert!(blob.pixels.iter().all(|v| *v == 0.0), "{id}"),
        Some(reference) => check_pixels(score, id, &blob, reference, pitch),
    }
    let (id, pixels) = match &reference {
        None => (id.to_owned(), &blob.pixels),
        Some(reference) => (format!("{id} of pixels"), reference),
    };
    let expected = &expected["moments"];
    Moments {
        id: &id,
        pixels,
        background: 0.0,
        pitch,
        expected,
        rounded: true,
    }
    .check(score);
}

#[test]
fn every_image_case() {
    let Some(data) = load() else {
        println!("skipped: no reference data (set TACTILE_DATA)");
        return;
    };
    let mut score = Score {
        worst: (0.0, String::new()),
        failed: Vec::new(),
    };
    let cases = data["cases"].as_array().unwrap();
    for case in cases {
        let (id, pitch) = (case["id"].as_str().unwrap(), number(&case["pitch"]));
        if case["kind"] == "given" {
            let (pixels, background) = (
                &image(&case["pixels"]).unwrap(),
                number(&case["background"]),
            );
            let expected = &case["expected"]["moments"];
            Moments {
                id,
                pixels,
                background,
                pitch,
                expected,
                rounded: false,
            }
            .check(&mut score);
        } else {
            check_blob(&mut score, case, id, pitch);
        }
    }
    println!(
        "{} cases; worst {:.3} of the allowance: {}",
        cases.len(),
        score.worst.0,
        score.worst.1
    );
    assert!(
        score.failed.is_empty(),
        "{} failed:\n{}",
        score.failed.len(),
        score.failed[..score.failed.len().min(40)].join("\n")
    );
}
